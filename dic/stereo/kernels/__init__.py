"""Warp kernels of the stereo match."""
