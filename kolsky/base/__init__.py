"""Measured histories, apparatus, units, errors and files. No physics."""
