"""Elements and Marlow's tables in the time loop."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
import warp as wp
from lane_kernels import EACH, MAPPINGS, N, inputs, launched, small_structs
from scipy.interpolate import CubicHermiteSpline

import explicit
from explicit import Model, Outcome, PlatenMotion, Samples, Sampling, cylinder, run
from explicit.arguments import body_of
from explicit.device import select_device
from explicit.elements import ELEMENTS, element
from explicit.elements.fbar import gauss_points
from explicit.layout.structs import GROUP
from explicit.materials import MarlowLaw, neo_hookean
from explicit.mesh import Mesh, deformation_gradient, element_geometry
from explicit.precision import PRECISIONS, Precision
from explicit.simd import Mapping
from explicit.time_loop.kernel import time_loop_kernel

# Elements: the registry, the Gauss points' constants, and an element that turns inside out.

RADIUS, LENGTH = 4.75e-3, 6.5e-3


def distorted() -> Mesh:
    mesh = cylinder(RADIUS, LENGTH, n_radial=4, n_axial=5)
    nodes = mesh.nodes.copy()
    inside = (nodes[:, 0] > 0) & (nodes[:, 0] < RADIUS) & (nodes[:, 1] > 0) & (nodes[:, 1] < LENGTH)
    nodes[inside] += np.random.default_rng(1).uniform(-2e-4, 2e-4, (int(inside.sum()), 2))
    return replace(mesh, nodes=nodes)


@pytest.mark.parametrize("name", list(ELEMENTS))
@pytest.mark.parametrize("precision", list(PRECISIONS))
def test_every_element_offers_its_volume_and_inverse_masses(name: str, precision: str) -> None:
    mesh = distorted()
    item = element(name)
    functions = item.functions(MarlowLaw, PRECISIONS[precision])
    shapes = item.shapes(mesh, 870.0, functions.Shape.numpy_dtype())
    assert item.name == name
    volume = np.asarray(shapes["volume"], dtype=float)
    rtol = 1e-13 if precision == "fp64" else 1e-6  # round-off
    np.testing.assert_allclose(volume.sum(), np.pi * RADIUS**2 * LENGTH, rtol=rtol)
    mass = (1.0 / np.asarray(shapes["inverse_mass_y"], dtype=float)).sum()
    np.testing.assert_allclose(mass, 870.0 * np.pi * RADIUS**2 * LENGTH, rtol=rtol)
    on_axis = mesh.on_axis[mesh.quads]
    assert (np.asarray(shapes["inverse_mass_r"])[on_axis] == 0.0).all()


@pytest.mark.parametrize("name", list(ELEMENTS))
@pytest.mark.parametrize("precision", list(PRECISIONS))
def test_every_element_reads_its_constants(name: str, precision: str) -> None:
    mesh = cylinder(RADIUS, LENGTH, n_radial=7, n_axial=11, grading=2.0)
    assert mesh.n_elements > 2 * GROUP
    where, numbers = select_device("cpu"), PRECISIONS[precision]
    motion = PlatenMotion(start=0.0, step=1.0, position=np.zeros(2), velocity=np.zeros(2))
    model = Model(mesh, 870.0, (neo_hookean(27e3),), (motion,), element=name)
    kernel = time_loop_kernel(MarlowLaw, model.faces, model.side, numbers, name)
    body = body_of(kernel, model, numbers, where)
    read_shape, Shape = kernel.element.read_shape, kernel.element.Shape

    @wp.kernel(module="unique", enable_backward=False)
    def read(constants: wp.array2d(dtype=numbers.real), shapes: wp.array(dtype=Shape)):
        shapes[wp.tid()] = read_shape(constants, wp.tid(), 1)

    shapes = wp.zeros(mesh.n_elements, dtype=Shape, device=where)
    wp.launch(read, mesh.n_elements, [body.shapes, shapes], device=where)
    got, wanted = shapes.numpy(), element(name).shapes(mesh, 870.0, Shape.numpy_dtype())
    for field in wanted.dtype.names:
        np.testing.assert_array_equal(got[field], wanted[field], err_msg=field)


def test_gauss_points_integrate_what_three_by_three_do() -> None:
    mesh = distorted()
    points, geometry = gauss_points(mesh), element_geometry(mesh)
    rtol = 1e-12  # both rules are exact for these integrands
    np.testing.assert_allclose(points.volume.sum(axis=1), geometry.volume, rtol=rtol)
    np.testing.assert_allclose(points.volume @ points.interpolation, geometry.corner_volume, rtol=rtol)
    for field, whole in (
        (
            points.gradient_r + points.hoop,
            geometry.gradient_r + geometry.hoop,
        ),  # hoop alone is not polynomial
        (points.gradient_y, geometry.gradient_y),
    ):
        mean = np.einsum("eg,ega->ea", points.volume, field) / geometry.volume[:, None]
        np.testing.assert_allclose(mean, whole, rtol=rtol, atol=1e-9)  # gradients are 1e3 1/m


def test_gauss_points_refuse_an_element_that_is_numbered_backwards() -> None:
    mesh = cylinder(RADIUS, LENGTH, n_radial=2, n_axial=2)
    quads = mesh.quads.copy()
    quads[3] = quads[3, ::-1]
    with pytest.raises(ValueError, match=r"element 3 has Jacobian -.* <= 0: number its corners counter-cl"):
        gauss_points(replace(mesh, quads=quads))


@pytest.mark.parametrize("name", list(ELEMENTS))
def test_an_element_that_turns_inside_out_ends_its_simulation(name: str) -> None:
    # The flyer goes through the other platen: the elements between them must turn over.
    times = np.array([0.0, 1.0])
    motion = PlatenMotion.sampled(
        lambda t: 2.0 * LENGTH * t, lambda t: 2.0 * LENGTH + 0.0 * t, start=0.0, end=1.0, n_knots=11
    )
    model = Model(
        cylinder(RADIUS, LENGTH, n_radial=2, n_axial=2), 870.0, (neo_hookean(27e3),), (motion,), element=name
    )
    response = run(model, Samples.of(poisson=0.495), Sampling(times, times))
    # The shrinking step of the last instants may come first, or outrun the one that was measured before.
    assert response.outcomes[0] in (Outcome.INVERTED, Outcome.STEP_COLLAPSED, Outcome.DIVERGED)
    assert response.failed_elements[0] in range(4)


MESH = explicit.cylinder(5e-3, 6e-3, n_radial=4, n_axial=5)


def test_a_uniform_stretch_and_a_shear_are_found_in_every_element() -> None:
    nodes = np.stack([MESH.nodes * [1.2, 0.7], MESH.nodes])
    F = deformation_gradient(MESH, nodes)
    assert F.shape == (2, MESH.n_elements, 3, 3)
    np.testing.assert_allclose(F[0], np.broadcast_to(np.diag([1.2, 0.7, 1.2]), F[0].shape), atol=1e-13)
    np.testing.assert_allclose(F[1], np.broadcast_to(np.eye(3), F[1].shape), atol=1e-13)
    # y = Y + g R: the only other entry is dy/dR; round-off.
    nodes = MESH.nodes + np.outer(MESH.nodes[:, 0], [0.0, 0.3])
    expected = np.eye(3)
    expected[1, 0] = 0.3
    F = deformation_gradient(MESH, nodes)
    np.testing.assert_allclose(F, np.broadcast_to(expected, F.shape), atol=1e-13)


def test_changes_of_volume_add_up() -> None:
    rng = np.random.default_rng(1)
    nodes = MESH.nodes * (1.0 + 1e-3 * rng.standard_normal(MESH.nodes.shape))
    F = deformation_gradient(MESH, nodes)
    moved = explicit.Mesh(nodes, MESH.quads, MESH.lower_face, MESH.upper_face, MESH.side)
    # To first order the sum of (det F - 1) dV is the change of volume of the straight-sided body; the rest is
    # of second order in 1e-3.
    volume = element_geometry(MESH).volume
    change = float(((np.linalg.det(F) - 1.0) * volume).sum())
    factor = MESH.volume / volume.sum()  # elements may count a radian or a turn
    assert factor * change == pytest.approx(moved.volume - MESH.volume, abs=2e-5 * MESH.volume)


def test_other_nodes_are_refused() -> None:
    with pytest.raises(ValueError, match=r"nodes must have shape \[..., 30, 2\]"):
        deformation_gradient(MESH, np.zeros((29, 2)))


# The tables of Marlow's law in the time loop, at any strain that a simulation can reach.


def law(n_knots: int = 6, seed: int = 1) -> MarlowLaw:
    rng = np.random.default_rng(seed)
    quotient, slope = rng.uniform(1e4, 3e4, n_knots), rng.uniform(-2e4, 4e4, n_knots)
    slope[-1] = 1.7e4
    return MarlowLaw(last=1.5, quotient=quotient, slope=slope)


@pytest.mark.parametrize("n_knots", [2, 3, 6, 129])
def test_its_cubics_are_those_of_hermite_and_a_straight_line_follows(n_knots: int) -> None:
    item = law(n_knots)
    knots, cubics = np.linspace(0.0, item.last, n_knots), item.cubics
    assert cubics.shape == (n_knots, 4)
    # SciPy has the highest power first, in s from the knot
    powers = CubicHermiteSpline(knots, item.quotient, item.slope).c[::-1].T
    expected = powers * item.step ** np.arange(4)
    np.testing.assert_allclose(cubics[:-1], expected, rtol=0, atol=1e-14 * 20 * 4e4)  # twenty roundings
    straight = [item.quotient[-1], item.slope[-1] * item.step, 0.0, 0.0]
    np.testing.assert_allclose(cubics[-1], straight, rtol=0, atol=1e-14 * 4e4)
    # value and slope at either end of an interval
    ends, rise = cubics.sum(axis=1), cubics @ [0.0, 1.0, 2.0, 3.0]
    np.testing.assert_allclose(ends[:-1], item.quotient[1:], rtol=1e-13)
    np.testing.assert_allclose(rise[:-1], item.slope[1:] * item.step, atol=1e-13 * 4e4)


def test_a_row_holds_header_cubics_and_energies() -> None:
    item = law()
    row = item.parameters()
    assert row[:4] == pytest.approx([1.5, 5.0, 0.3, 1 / 0.3], rel=1e-15)
    np.testing.assert_array_equal(row[4:28].reshape(6, 4), item.cubics)
    np.testing.assert_array_equal(row[28:], item.knot_energy)


@cache
def law_kernel(numbers: Precision) -> Any:
    structs = small_structs(numbers)
    Body, Batch, State, Output = structs.Body, structs.Batch, structs.State, structs.Output
    stress, tangent, energy = MarlowLaw.kernel_functions(numbers)
    zero, one = numbers.real(0.0), numbers.real(1.0)

    @wp.kernel(module="unique", enable_backward=False)
    def kernel(body: Body, batch: Batch, state: State, output: Output, first: int):
        index, lane = wp.tid()
        sample = first + index
        row, rr = batch.rows[batch.k[sample]], batch.x[sample]
        if lane == 0:
            tau = stress(rr, one, zero, one, row)
            output.values[sample, 0] = tau[0]
            output.values[sample, 1] = tangent(rr, one, zero, one, row)
            output.values[sample, 2] = energy(rr, one, zero, one, row)

    return kernel


def evaluated(numbers: Precision, mapping: Mapping | None, s: np.ndarray) -> np.ndarray:
    """Stress, bound of the tangent and energy where b_bar = (1 + s^2, 1, 0, 1)."""
    rows = np.stack([law(seed=seed).parameters() for seed in range(5)]).astype(numbers.dtype)
    given = replace(inputs(numbers), rows=rows, x=(1.0 + s**2).astype(numbers.dtype))
    return launched(law_kernel(numbers), numbers, mapping, given).values


def strains(numbers: Precision) -> np.ndarray:
    """At rest, between the knots, on the last one, past it, and as a simulation that diverges has them: up to
    where s^4 is still a number. From 6e8 on no integer counts the steps of s."""
    last = 2e9 if numbers.name == "fp32" else 1e70
    return np.array([0.0, 0.01, 0.3, 0.5, 1.2, 1.4999, 1.5, 1.6, 40.0, 1e6, 7e8, 1e9, last])


@EACH
def test_the_law_holds_at_any_strain(numbers: Precision, mapping: Mapping | None) -> None:
    s, k = strains(numbers), inputs(numbers).k
    got = evaluated(numbers, mapping, s).astype(float)
    b_bar = np.column_stack([1.0 + s**2, np.ones(N), np.zeros(N), np.ones(N)])
    b_bar = b_bar.astype(numbers.dtype).astype(float)
    # the strain is a difference of numbers of size 1, which fp32 knows to 1e-7: at s = 0.01 to 1e-3 of s^2
    rtol = 1e-11 if numbers.name == "fp64" else 2e-3
    for i in range(N):
        item = law(seed=k[i])
        assert got[i, 0] == pytest.approx(item.stress(b_bar[i])[0], rel=rtol, abs=1e-6)
        assert got[i, 2] == pytest.approx(item.energy(b_bar[i]), rel=rtol, abs=1e-6)
    assert np.isfinite(got[:, :3]).all()
    # past the data 2 U' is a straight line, and its slope is the last one
    past = s > 1.5
    trace = b_bar[past].sum(axis=1)
    value = np.array([law(seed=j).two_u_prime(x) for j, x in zip(k[past], s[past], strict=True)])
    slope = np.array([law(seed=j).slope[-1] for j in k[past]])
    squared = ((b_bar[past][:, [0, 1, 3]] - trace[:, None] / 3) ** 2).sum(axis=1)
    bound = value * b_bar[past, 0] + slope / s[past] * squared
    np.testing.assert_allclose(got[past, 1], bound, rtol=rtol)


def test_both_mappings_give_the_same_bits() -> None:
    numbers = PRECISIONS["fp64"]
    one, other = (evaluated(numbers, mapping, strains(numbers)) for mapping in MAPPINGS)
    np.testing.assert_array_equal(one, other)


@EACH
def test_what_is_no_strain_at_all_disturbs_nobody(numbers: Precision, mapping: Mapping | None) -> None:
    s = np.full(N, 0.7)
    whole = evaluated(numbers, mapping, s)
    s[[1, 4, 7]] = np.inf, np.nan, 1e150 if numbers.name == "fp64" else 1e18
    got, others = evaluated(numbers, mapping, s), np.delete(np.arange(N), [1, 4, 7])
    np.testing.assert_array_equal(got[others], whole[others])
    assert not np.isfinite(got[[1, 4], 0]).any()
