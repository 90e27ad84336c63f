"""Warp kernels of the sums over Gauss points, for models on a GPU."""
