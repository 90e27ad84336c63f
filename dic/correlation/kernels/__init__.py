"""Warp kernels of the subset match; the only package of `dic` that uses NVIDIA Warp."""
