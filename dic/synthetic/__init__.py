"""Synthetic pictures with known motion, for tests of the measurement."""
