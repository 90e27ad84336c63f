"""Blocks of a GPU for a simulation: how many, and of how many threads."""

from collections.abc import Callable
from typing import Any

from explicit.time_loop.lanes import BLOCK, SMALL_BLOCK

CLUSTERS = (16, 4)
"""Blocks that may share a simulation that does not fit into the shared memory of one, the most first."""
CLUSTER_ARCH = 90
"""Architecture from which blocks can share one."""
CHIP_ARCHES = (90,)
"""Architectures on which the shared memories of a cluster's blocks are known to lie as
`explicit.time_loop.chip_layout` counts on; on others blocks share a simulation in global memory."""
SPREAD = 0.8
"""Share of the multiprocessors that clusters may ask for: each lies within one group of the device, and what
does not fill a group stays free."""


def block_for(n_samples: int, device: Any, on_chip: bool) -> int:
    """Threads of a block for a batch on a Warp device."""
    return SMALL_BLOCK if device.is_cuda and on_chip and n_samples > device.sm_count else BLOCK


def knows_chips(device: Any) -> bool:
    """True if blocks can have a simulation in their shared memories on a Warp device."""
    return bool(device.is_cuda) and device.arch in CHIP_ARCHES


def cluster_for(
    n_samples: int,
    n_elements: int,
    device: Any,
    on_chip: bool,
    fits: Callable[[int], bool] = lambda blocks: False,
) -> int:
    """Blocks that share a simulation of a batch on a Warp device: as many as are free, and as have work.

    The fewest in whose shared memories it `fits`, if there are any.
    """
    if on_chip or not device.is_cuda or device.arch < CLUSTER_ARCH or n_elements <= BLOCK - 32:
        return 1
    free = [cluster for cluster in CLUSTERS if n_samples * cluster <= SPREAD * device.sm_count]
    fitting = [cluster for cluster in free if fits(cluster)] if knows_chips(device) else []
    # the next smaller choice must have fewer workers than there are elements
    busy = [cluster for cluster in free if n_elements > cluster // 4 * (BLOCK - 32)]
    return fitting[-1] if fitting else busy[0] if busy else 1
