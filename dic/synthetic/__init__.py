"""Synthetic pictures with known motion, for verification of the measurement."""
