"""Regions drawn by hand over the pictures: checks, the edit of the TOML file, a local page, a grid."""
