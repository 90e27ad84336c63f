"""Warp kernels of the renderer: rays on bodies and boards, and the filter from rays to pixels."""
