"""Measured histories, apparatus, units, errors, files; no physics."""
