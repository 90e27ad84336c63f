"""The Kolsky test and its meaning: apparatus, shots, identification, reports, command line."""
