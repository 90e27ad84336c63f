"""Elements: the registry, the Gauss points' constants, and an element that turns inside out."""

from dataclasses import replace

import numpy as np
import pytest
import warp as wp

import explicit
from explicit import Model, Outcome, PlatenMotion, Samples, Sampling, cylinder, run
from explicit.arguments import body_of
from explicit.device import select_device
from explicit.elements import ELEMENTS, element
from explicit.elements.fbar import gauss_points
from explicit.layout.structs import GROUP
from explicit.materials import MarlowLaw, neo_hookean
from explicit.mesh import Mesh, deformation_gradient, element_geometry
from explicit.precision import PRECISIONS
from explicit.time_loop.kernel import time_loop_kernel

RADIUS, LENGTH = 4.75e-3, 6.5e-3


def distorted() -> Mesh:
    mesh = cylinder(RADIUS, LENGTH, n_radial=4, n_axial=5)
    nodes = mesh.nodes.copy()
    inside = (nodes[:, 0] > 0) & (nodes[:, 0] < RADIUS) & (nodes[:, 1] > 0) & (nodes[:, 1] < LENGTH)
    nodes[inside] += np.random.default_rng(1).uniform(-2e-4, 2e-4, (int(inside.sum()), 2))
    return replace(mesh, nodes=nodes)


def test_an_unknown_element_is_refused_with_the_names_there_are() -> None:
    with pytest.raises(ValueError, match=r"element must be one of \['fbar', 'one_point'\], got 'Q8'"):
        element("Q8")


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
        cylinder(RADIUS, LENGTH, n_radial=2, n_axial=2),
        870.0,
        (neo_hookean(27e3),),
        (motion,),
        element=name,
    )
    response = run(model, Samples.of(poisson=0.495), Sampling(times, times))
    # The shrinking step of the last instants may come first, or outrun the one that was measured before.
    assert response.outcomes[0] in (Outcome.INVERTED, Outcome.STEP_COLLAPSED, Outcome.DIVERGED)
    assert response.failed_elements[0] in range(4)


MESH = explicit.cylinder(5e-3, 6e-3, n_radial=4, n_axial=5)


def test_a_uniform_stretch_is_found_in_every_element() -> None:
    nodes = np.stack([MESH.nodes * [1.2, 0.7], MESH.nodes])
    F = deformation_gradient(MESH, nodes)
    assert F.shape == (2, MESH.n_elements, 3, 3)
    np.testing.assert_allclose(F[0], np.broadcast_to(np.diag([1.2, 0.7, 1.2]), F[0].shape), atol=1e-13)
    np.testing.assert_allclose(F[1], np.broadcast_to(np.eye(3), F[1].shape), atol=1e-13)


def test_a_shear_along_the_axis() -> None:
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
