"""Blocks of a GPU for a simulation: how many, and of how many threads."""

from typing import Any

from explicit.time_loop.lanes import BLOCK, SMALL_BLOCK

CLUSTERS = (16, 4)
"""Blocks that may share a simulation whose state is in global memory, the most first."""
CLUSTER_ARCH = 90
"""Architecture from which blocks can share one."""
SPREAD = 0.8
"""Share of the multiprocessors that clusters may ask for: each lies within one group of the device, and what
does not fill a group stays free."""


def block_for(n_samples: int, device: Any, on_chip: bool) -> int:
    """Threads of a block for a batch on a Warp device."""
    return SMALL_BLOCK if device.is_cuda and on_chip and n_samples > device.sm_count else BLOCK


def cluster_for(n_samples: int, n_elements: int, device: Any, on_chip: bool) -> int:
    """Blocks that share a simulation of a batch on a Warp device: as many as are free, and as have work."""
    if on_chip or not device.is_cuda or device.arch < CLUSTER_ARCH:
        return 1
    for cluster in CLUSTERS:
        fewer = cluster // 4 * (BLOCK - 32)  # workers of the next smaller choice
        if n_elements > fewer and n_samples * cluster <= SPREAD * device.sm_count:
            return cluster
    return 1
