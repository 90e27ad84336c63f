"""How many blocks of a GPU share a simulation."""

from dataclasses import dataclass

import pytest

from explicit.layout.lanes import BLOCK, CLUSTERS, SPREAD, cluster_for, supports_chip_memory


@dataclass(frozen=True)
class Device:
    """What is asked of a Warp device."""

    is_cuda: bool = True
    arch: int = 90
    sm_count: int = 132


WORKERS = BLOCK - 32
FEW = int(SPREAD * 132)
LARGE = 64 * 86


def test_a_large_mesh_that_is_alone_has_the_most() -> None:
    assert cluster_for(1, LARGE, Device(), False) == CLUSTERS[0] == 16
    assert cluster_for(FEW // 16, LARGE, Device(), False) == 16


def test_more_simulations_have_fewer_each() -> None:
    assert cluster_for(FEW // 16 + 1, LARGE, Device(), False) == 4
    assert cluster_for(FEW // 4, LARGE, Device(), False) == 4
    assert cluster_for(FEW // 4 + 1, LARGE, Device(), False) == 1


@pytest.mark.parametrize(
    ("n_elements", "blocks"), [(WORKERS, 1), (WORKERS + 1, 4), (4 * WORKERS, 4), (4 * WORKERS + 1, 16)]
)
def test_no_blocks_without_work(n_elements: int, blocks: int) -> None:
    assert cluster_for(1, n_elements, Device(), False) == blocks


@pytest.mark.parametrize(
    ("device", "on_chip"), [(Device(), True), (Device(is_cuda=False), False), (Device(arch=80), False)]
)
def test_others_have_one(device: Device, on_chip: bool) -> None:
    assert cluster_for(1, LARGE, device, on_chip) == 1


def test_the_fewest_blocks_on_whose_chips_a_mesh_fits() -> None:
    both, most = {4, 16}.__contains__, {16}.__contains__
    assert cluster_for(1, 4 * WORKERS, Device(), False, both) == 4
    assert cluster_for(1, LARGE, Device(), False, both) == 4
    assert cluster_for(1, WORKERS + 1, Device(), False, most) == 16
    assert cluster_for(1, WORKERS, Device(), False, most) == 1  # one block has a worker for every element
    # where the chips of as many blocks are not free, those that are share it in global memory
    assert cluster_for(FEW // 16 + 1, LARGE, Device(), False, most) == 4


def test_on_other_architectures_blocks_share_a_mesh_in_global_memory() -> None:
    assert supports_chip_memory(Device())
    later = Device(arch=100)
    assert not supports_chip_memory(later)
    assert not supports_chip_memory(Device(is_cuda=False))
    assert cluster_for(1, 4 * WORKERS + 1, later, False, {4, 16}.__contains__) == 16
    assert cluster_for(1, 4 * WORKERS + 1, Device(), False, {4, 16}.__contains__) == 4
