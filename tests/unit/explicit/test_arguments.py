"""Where nodes and constants lie in the time loop's arrays."""

from dataclasses import replace

import numpy as np
import pytest

from explicit import Mesh, Model, PlatenMotion, Sampling, cylinder
from explicit.arguments import SPARE, body_of, fits_on_chip, node_order, output_of
from explicit.device import select_device
from explicit.layout.lanes import WARPS
from explicit.layout.state import (
    ON_CHIP_BOUNDARY,
    ON_CHIP_CONTROL,
    ON_CHIP_ELEMENTS,
    ON_CHIP_NODES,
    on_chip_elements,
)
from explicit.layout.structs import CONTROL_SIZE, GROUP, Total
from explicit.materials import MarlowLaw, neo_hookean
from explicit.mesh import element_geometry
from explicit.precision import PRECISIONS
from explicit.time_loop.kernel import TimeLoopKernel, time_loop_kernel
from explicit.time_loop.node_sweeps import VALENCE

DENSITY = 870.0
SIZES = [(2, 2), (4, 6), (9, 7), (16, 22), (33, 9)]


def shuffled(n_radial: int, n_axial: int) -> Mesh:
    """A cylinder whose nodes and elements are numbered at random."""
    mesh, rng = cylinder(4.75e-3, 6.5e-3, n_radial=n_radial, n_axial=n_axial), np.random.default_rng(7)
    new, elements = rng.permutation(mesh.n_nodes), rng.permutation(mesh.n_elements)
    return Mesh(
        nodes=mesh.nodes[np.argsort(new)],
        quads=new[mesh.quads][elements],
        lower_face=new[mesh.lower_face],
        upper_face=new[mesh.upper_face],
        side=new[mesh.side],
    )


def model_of(mesh: Mesh) -> Model:
    motion = PlatenMotion(start=0.0, step=1.0, position=np.zeros(2), velocity=np.zeros(2))
    return Model(mesh, DENSITY, (neo_hookean(27e3),), (motion,))


def kernel_of(model: Model) -> TimeLoopKernel:
    return time_loop_kernel(MarlowLaw, model.faces, model.side, PRECISIONS["fp64"], model.element)


def surface_of(mesh: Mesh) -> set[int]:
    return set(mesh.lower_face) | set(mesh.upper_face) | set(mesh.side)


@pytest.mark.parametrize("size", SIZES)
def test_every_node_has_a_place_and_the_surface_is_last(size: tuple[int, int]) -> None:
    mesh = shuffled(*size)
    place, n_inner, first_boundary = node_order(mesh)
    surface = surface_of(mesh)
    inner = [n for n in range(mesh.n_nodes) if n not in surface]
    assert sorted(place[inner]) == list(range(n_inner))
    assert sorted(place[list(surface)]) == list(range(first_boundary, first_boundary + len(surface)))
    assert n_inner + len(surface) == mesh.n_nodes
    assert first_boundary % GROUP == 0
    assert 0 <= first_boundary - n_inner < GROUP
    # in the order of the mesh, inside as on the surface
    assert (np.diff(place[inner]) > 0).all()
    assert (np.diff(place[sorted(surface)]) > 0).all()


def entries(table: np.ndarray, constants: int) -> np.ndarray:
    """A grouped table on the device, shape [constants, places], as `grouped` documents it."""
    groups = table[:, : constants * GROUP]
    assert table.shape[1] == groups.shape[1] + SPARE
    return groups.reshape(-1, constants, GROUP).transpose(1, 0, 2).reshape(constants, -1)


@pytest.mark.parametrize("size", SIZES[:4])
@pytest.mark.parametrize("on_chip", [False, True])
def test_constants_lie_at_the_places_of_their_nodes(size: tuple[int, int], on_chip: bool) -> None:
    mesh, where, numbers = shuffled(*size), select_device("cpu"), PRECISIONS["fp64"]
    model = model_of(mesh)
    body = body_of(kernel_of(model), model, numbers, where, on_chip)
    place, n_inner, first_boundary = node_order(mesh)
    assert (body.n_inner, body.first_boundary) == (n_inner, first_boundary)
    assert body.n_boundary == mesh.n_nodes - n_inner
    assert body.n_nodes == place.max() + 1
    quads = entries(body.quads.numpy(), 4)[:, : mesh.n_elements]
    np.testing.assert_array_equal(quads, place[mesh.quads].T)
    mass = np.zeros(mesh.n_nodes)
    np.add.at(mass, mesh.quads, DENSITY * element_geometry(mesh).corner_volume)
    masses = entries(body.masses.numpy(), 4)
    rtol = 1e-14  # a node's corners may be added in another order
    np.testing.assert_allclose(masses[0, place], mass, rtol=rtol)
    np.testing.assert_allclose(masses[1, place], np.where(mesh.nodes[:, 0] == 0.0, 0.0, 1 / mass), rtol=rtol)
    np.testing.assert_allclose(masses[2, place], 1 / mass, rtol=rtol)
    np.testing.assert_array_equal(body.reference_r.numpy()[place], mesh.nodes[:, 0])
    np.testing.assert_array_equal(body.reference_y.numpy()[place], mesh.nodes[:, 1])
    # every corner force is gathered once, by the node it acts on; what is left over reads zeros behind them
    slots = on_chip_elements(numbers) if on_chip else mesh.n_elements
    corners = entries(body.corners.numpy(), VALENCE)
    gathered = [(c, n) for n in range(mesh.n_nodes) for c in corners[:, place[n]] if c < 4 * slots]
    assert len(gathered) == len(set(gathered)) == 4 * mesh.n_elements
    for c, n in gathered:
        assert mesh.quads[c % slots, c // slots] == n
    # the places between, where no node is, weigh nothing
    assert (masses[:, n_inner:first_boundary] == 0.0).all()


def test_what_is_recorded_is_named_by_place() -> None:
    mesh, where = shuffled(4, 6), select_device("cpu")
    model, times = model_of(mesh), np.array([0.0, 1.0])
    output, _ = output_of(kernel_of(model), mesh, 3, Sampling(times, times), mesh.side, where)
    assert output.n_recorded == len(mesh.side)
    np.testing.assert_array_equal(output.nodes.numpy()[: len(mesh.side)], node_order(mesh)[0][mesh.side])
    assert output.position.shape == (3, 2, len(mesh.side), 2)
    assert np.isnan(output.position.numpy()).all()


def test_a_body_is_made_once_for_a_mesh_and_what_is_made_of_it() -> None:
    mesh, where, numbers = shuffled(2, 2), select_device("cpu"), PRECISIONS["fp64"]
    model = model_of(mesh)
    kernel = kernel_of(model)
    first = body_of(kernel, model, numbers, where)
    assert body_of(kernel, model_of(mesh), numbers, where) is first
    heavier = replace(model, density=2 * DENSITY)
    again = body_of(kernel, heavier, numbers, where)
    np.testing.assert_allclose(
        entries(again.masses.numpy(), 4)[0], 2 * entries(first.masses.numpy(), 4)[0], rtol=1e-14
    )
    assert body_of(kernel, model, numbers, where, on_chip=True) is not first
    assert body_of(kernel, replace(model, mesh=replace(mesh)), numbers, where) is not first


def fan(n: int) -> Mesh:
    """Elements around a node away from the axis: kites between its neighbours and a ring of corners."""
    angle = np.linspace(0.0, 2.0 * np.pi, 2 * n, endpoint=False)
    ring = np.column_stack([2.0 + np.cos(angle), np.sin(angle)])
    nodes = np.vstack([[2.0, 0.0], ring])
    quads = [[0, 1 + 2 * k, 2 + 2 * k, 1 + (2 * k + 2) % (2 * n)] for k in range(n)]
    low, high = int(nodes[:, 1].argmin()), int(nodes[:, 1].argmax())
    side = np.array([low, int(nodes[:, 0].argmax()), high])
    return Mesh(nodes, np.array(quads), np.array([low]), np.array([high]), side)


def test_a_node_where_five_elements_meet_is_refused() -> None:
    where, numbers = select_device("cpu"), PRECISIONS["fp64"]
    four, five = model_of(fan(4)), model_of(fan(5))
    assert body_of(kernel_of(four), four, numbers, where).n_elements == 4
    with pytest.raises(ValueError, match=r"^at most 4 elements may meet at a node, 5 do at node 0$"):
        body_of(kernel_of(five), five, numbers, where)


def test_what_fits_on_a_chip() -> None:
    fp64, fp32 = PRECISIONS["fp64"], PRECISIONS["fp32"]
    usual, finer = (cylinder(1.0, 1.0, n_radial=r, n_axial=a) for r, a in ((16, 22), (24, 32)))
    assert fits_on_chip(usual, fp64)
    assert fits_on_chip(usual, fp32)
    assert not fits_on_chip(finer, fp64)  # as docs/theory/speed.md says
    assert fits_on_chip(finer, fp32)
    assert usual.n_elements <= ON_CHIP_ELEMENTS < finer.n_elements
    thin = cylinder(1.0, 1.0, n_radial=2, n_axial=100)
    assert thin.n_elements <= ON_CHIP_ELEMENTS
    assert len(surface_of(thin)) > ON_CHIP_BOUNDARY
    assert not fits_on_chip(thin, fp64)


def test_what_lies_on_a_chip_has_room_there() -> None:
    assert CONTROL_SIZE + Total.COUNT * WARPS <= ON_CHIP_CONTROL
    fields = 4 * ON_CHIP_NODES + 2 * (4 * ON_CHIP_ELEMENTS + 1)
    sums, marks = 3 * ON_CHIP_BOUNDARY + ON_CHIP_CONTROL, ON_CHIP_BOUNDARY
    assert 8 * (fields + sums) + 4 * marks <= 48 * 1024  # what a block gets without a request
