"""Warp functions of stress and tangent, and the kernels that evaluate them at all Gauss points."""
