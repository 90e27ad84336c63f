"""Warp kernels of the renderer: rays on bodies of revolution and boards, and the filter from rays to pixels."""
