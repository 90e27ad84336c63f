"""Warp kernels that fill the fronts of a factorisation."""
