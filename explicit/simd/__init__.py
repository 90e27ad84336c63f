"""SIMD lanes on the CPU: the scalar source of the time loop runs over packs of simulations or of elements."""

from explicit.simd.kernel import PACK_BYTES, LaneKernel, Mapping, is_translated, lane_kernel

__all__ = ["PACK_BYTES", "LaneKernel", "Mapping", "is_translated", "lane_kernel"]
