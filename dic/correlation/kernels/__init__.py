"""Warp kernels of the subset match; the one place of `dic` that knows Warp."""
