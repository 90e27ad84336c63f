"""Where a simulation lies in the shared memories of several blocks of a GPU."""

import numpy as np
import pytest

from explicit import Mesh, Model, PlatenMotion, cylinder
from explicit.arguments import body_of, fits_on_several, node_order
from explicit.device import select_device
from explicit.layout.lanes import BLOCK
from explicit.layout.state import (
    BLOCK_DISTANCE,
    BOUNDARY,
    fits_on_chips,
    numbers_between_blocks,
    spread_corners,
    spread_nodes,
)
from explicit.layout.structs import GROUP
from explicit.materials import MarlowLaw, neo_hookean
from explicit.precision import PRECISIONS, Precision
from explicit.time_loop.kernel import TimeLoopKernel, time_loop_kernel

LARGE = [((24, 32), 4), ((40, 28), 4), ((64, 86), 16), ((33, 9), 4)]


def kernel_of(blocks: int, numbers: Precision) -> TimeLoopKernel:
    return time_loop_kernel(MarlowLaw, "bonded", "bonded", numbers, "one_point", True, cluster=blocks)


def model_of(mesh: Mesh) -> Model:
    motion = PlatenMotion(start=0.0, step=1.0, position=np.zeros(2), velocity=np.zeros(2))
    return Model(mesh, 870.0, (neo_hookean(27e3),), (motion,))


def entries(groups: np.ndarray, constants: int) -> np.ndarray:
    """Constants of a grouped table by element or node, shape [constants, n]."""
    values = groups[:, : constants * GROUP].reshape(-1, constants, GROUP)
    return values.transpose(1, 0, 2).reshape(constants, -1)


def parted(numbers: Precision, place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Block and place in its shared memory."""
    return place // numbers_between_blocks(numbers), place % numbers_between_blocks(numbers)


@pytest.mark.parametrize("precision", list(PRECISIONS))
@pytest.mark.parametrize(("size", "blocks"), LARGE)
def test_every_force_is_gathered_once_by_the_node_it_acts_on(
    size: tuple[int, int], blocks: int, precision: str
) -> None:
    mesh, numbers = cylinder(4.75e-3, 6.5e-3, n_radial=size[0], n_axial=size[1]), PRECISIONS[precision]
    assert fits_on_several(mesh, blocks)
    body = body_of(kernel_of(blocks, numbers), model_of(mesh), numbers, select_device("cpu"), on_chip=True)
    order, n_inner, first_boundary = node_order(mesh)
    place = spread_nodes(order, first_boundary, blocks, numbers)
    quads = entries(body.quads.numpy(), 4)[:, : mesh.n_elements]
    np.testing.assert_array_equal(quads, place[mesh.quads].T)
    # nodes have places of their own; the last block has the boundary, the others the interior
    assert len(np.unique(place)) == mesh.n_nodes
    block, inside = parted(numbers, place)
    assert ((block == blocks - 1) == (order >= n_inner)).all()
    assert inside.max() < BLOCK
    # a corner's force lies in the block of its element, behind those of the corners before
    element, corner = np.divmod(np.arange(4 * mesh.n_elements), 4)
    found = spread_corners(element, corner, numbers)
    assert len(np.unique(found)) == 4 * mesh.n_elements
    owner, slot = parted(numbers, found)
    np.testing.assert_array_equal(owner, element // BLOCK)
    np.testing.assert_array_equal(slot, corner * BLOCK + element % BLOCK)
    acts_on = dict(zip(found.tolist(), mesh.quads[element, corner].tolist(), strict=True))
    corners = entries(body.corners.numpy(), 4)
    gathered = []
    for n in range(mesh.n_nodes):
        for c in corners[:, order[n]].tolist():
            if c in acts_on:
                assert acts_on[c] == n
                gathered.append(c)
            else:  # what holds zero, in the node's own block
                assert (c // numbers_between_blocks(numbers), c % numbers_between_blocks(numbers)) == (
                    block[n],
                    4 * BLOCK,
                )
    assert sorted(gathered) == sorted(acts_on)


def test_numbers_are_bytes_apart() -> None:
    for numbers in PRECISIONS.values():
        assert numbers_between_blocks(numbers) * numbers.dtype().itemsize == BLOCK_DISTANCE == 2**24
        assert 16 * numbers_between_blocks(numbers) < 2**31  # sixteen blocks, by 32-bit integers


def test_what_fits() -> None:
    full = 3 * BLOCK
    assert fits_on_chips(full, full, BOUNDARY, 4)
    assert not fits_on_chips(full + 1, full, BOUNDARY, 4)
    assert not fits_on_chips(full, full + 1, BOUNDARY, 4)
    assert not fits_on_chips(full, full, BOUNDARY + 1, 4)
    assert fits_on_several(cylinder(1.0, 1.0, n_radial=64, n_axial=86), 16)
    assert not fits_on_several(cylinder(1.0, 1.0, n_radial=64, n_axial=86), 4)
