"""Rejected inputs of the solver and their messages: mesh, model, samples, sampling, stepping, motion."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import warp as wp
from scipy.interpolate import CubicHermiteSpline

import explicit
from explicit.arguments import SPARE, batch_of, body_of, fits_on_chip, node_order, output_of
from explicit.contact import contact_law
from explicit.device import select_device
from explicit.elements import element
from explicit.layout import state
from explicit.layout.lanes import WARPS
from explicit.layout.structs import CONTROL_SIZE, GROUP, Total
from explicit.materials import MarlowLaw, bulk_modulus, law_class, neo_hookean
from explicit.mesh import element_geometry
from explicit.precision import PRECISIONS, precision
from explicit.time_loop.kernel import TimeLoopKernel, time_loop_kernel
from explicit.time_loop.node_sweeps import VALENCE, boundary_functions


def motion(start: float = 0.0, n_knots: int = 5) -> explicit.PlatenMotion:
    return explicit.PlatenMotion.sampled(
        lambda t: 1e-4 * (t - start), lambda t: np.full_like(t, 1e-4), start=start, end=start + 1.0,
        n_knots=n_knots,
    )  # fmt: skip


def model(**change: Any) -> explicit.Model:
    values: dict[str, Any] = {
        "mesh": explicit.cylinder(1e-3, 1e-3, n_radial=2, n_axial=2),
        "density": 1000.0,
        "materials": (neo_hookean(1e4),),
        "motions": (motion(),),
    }
    return explicit.Model(**(values | change))


class OtherLaw(MarlowLaw):
    """A second class of law."""


def body(radius: float = 1e-3, length: float = 2e-3, **change: Any) -> explicit.Mesh:
    return explicit.cylinder(radius, length, **({"n_radial": 2, "n_axial": 3, "grading": 1.0} | change))


def platen(**change: Any) -> explicit.PlatenMotion:
    good = {"start": 0.0, "step": 0.5, "position": np.array([0.0, 1.0, 2.0]), "velocity": np.ones(3)}
    return explicit.PlatenMotion(**(good | change))


REFUSED: dict[Callable[..., Any], list[tuple[dict[str, Any], str]]] = {
    body: [
        ({"radius": 0.0}, r"radius and length must be > 0 m, got 0.0 and 0.002"),
        ({"length": -1.0}, r"radius and length must be > 0 m, got 0.001 and -1.0"),
        ({"radius": float("nan")}, r"radius and length must be > 0 m, got nan"),
        ({"n_radial": 1}, r"n_radial and n_axial must be >= 2, got 1 and 3"),
        ({"n_axial": 0}, r"n_radial and n_axial must be >= 2, got 2 and 0"),
        ({"grading": 0.5}, r"grading must be >= 1, got 0.5"),
        ({"grading": float("nan")}, r"grading must be >= 1, got nan"),
    ],
    model: [
        ({"density": -870.0}, r"density must be > 0 kg/m\^3 and finite, got -870.0"),
        ({"density": 0.0}, r"density must be > 0"),
        ({"density": float("nan")}, r"density must be > 0 kg/m\^3 and finite, got nan"),
        ({"materials": ()}, "a model needs material laws, all of one class"),
        (
            {"materials": (neo_hookean(1e4), OtherLaw(1.0, np.ones(3), np.zeros(3)))},
            "a model needs material laws, all of one class",
        ),
        ({"motions": ()}, "a model needs flyer motions, all with one start time"),
        ({"motions": (motion(), motion(start=0.5))}, "a model needs flyer motions, all with one start time"),
        ({"damping_kind": "shear"}, "damping_kind must be 'deviatoric' or 'full', got 'shear'"),
        ({"hourglass": -0.1}, "hourglass must be >= 0, got -0.1"),
        ({"past_data": "hold"}, "past_data must be 'continue' or 'stop', got 'hold'"),
        ({"hourglass_form": "e"}, "hourglass_form must be 'stiffness' or 'viscous', got 'e'"),
        ({"element": "cubic"}, r"element must be one of \['.*one_point'\], got 'cubic'"),
        ({"faces": "sticky"}, r"contact law must be one of \['bonded', .*\], got 'sticky'"),
        ({"side": "none"}, r"contact law must be one of .*, got 'none'"),
    ],
    explicit.Samples.of: [
        ({"stiffness_factor": 0.0}, "stiffness_factor must be > 0, got 0.0"),
        ({"stiffness_factor": [1.0, -0.5]}, "stiffness_factor must be > 0, got -0.5"),
        ({"damping": -1e-5}, "damping must be >= 0 s, got -1e-05"),
        ({"friction": -0.1}, "friction must be >= 0, got -0.1"),
        ({"mass_damping": -1.0}, "mass_damping must be >= 0 1/s, got -1.0"),
        ({"poisson": 0.5}, r"poisson must be in \[0, 0.49999\], got 0.5"),
        ({"poisson": [0.49, -0.1]}, r"poisson must be in \[0, 0.49999\], got -0.1"),
        ({"poisson": float("nan")}, r"poisson must be in \[0, 0.49999\], got nan"),
        ({"friction": float("nan")}, "friction must be >= 0, got nan"),
        ({"release_stress": -1.0}, "release_stress must be >= 0 Pa, got -1.0"),
        ({"release_stress": [1e3, float("nan")]}, "release_stress must be >= 0 Pa, got nan"),
        ({"contact_stiffness": 0.0}, "contact_stiffness must be > 0 Pa/m, got 0.0"),
        ({"contact_stiffness": float("inf")}, "contact_stiffness must be finite, got inf"),
    ],
    explicit.Stepping: [
        ({"safety": 0.0}, r"safety must be in \(0, 1\], got 0.0"),
        ({"safety": 1.1}, r"safety must be in \(0, 1\], got 1.1"),
        ({"safety": float("nan")}, r"safety must be in \(0, 1\], got nan"),
        ({"measure_every": 0}, "measure_every must be >= 1, got 0"),
        ({"largest_step": 0.0}, "largest_step must be > 0 s, got 0.0"),
        ({"floor": -1.0}, r"floor must be in \[0, 1\), got -1.0"),
        ({"floor": float("nan")}, r"floor must be in \[0, 1\), got nan"),
        ({"max_steps": 0}, "max_steps must be >= 1, got 0"),
        ({"bound": "guess"}, "bound must be 'trace' or 'eigenvalue', got 'guess'"),
        ({"precision": "fp16"}, "precision must be 'fp32' or 'fp64', got 'fp16'"),
    ],
    platen: [
        ({"velocity": np.zeros(2)}, "as many velocities as positions, at least 2"),
        ({"position": np.zeros(1), "velocity": np.zeros(1)}, "as many velocities as positions, at least 2"),
        ({"step": 0.0}, "step must be > 0 s, got 0.0"),
        ({"step": float("nan")}, "step must be > 0 s, got nan"),
        ({"position": np.array([0.0, np.nan, 1.0])}, "a motion must be finite everywhere"),
        ({"velocity": np.array([0.0, np.inf, 1.0])}, "a motion must be finite everywhere"),
        ({"position": np.array([1e-3, 2e-3, 3e-3])}, "a motion starts at displacement 0, got 0.001 m"),
    ],
}


@pytest.mark.parametrize(
    ("make", "change", "message"), [(make, *one) for make, cases in REFUSED.items() for one in cases]
)
def test_impossible_inputs_are_refused(
    make: Callable[..., Any], change: dict[str, Any], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        make(**change)


# Mesh ------------------------------------------------------------------------------------------------


def test_a_cylinder_has_the_volume_and_the_node_sets_of_a_cylinder() -> None:
    mesh = explicit.cylinder(2e-3, 3e-3, n_radial=3, n_axial=5, grading=2.0)
    assert (mesh.n_nodes, mesh.n_elements) == (4 * 6, 3 * 5)
    assert mesh.length == pytest.approx(3e-3, rel=1e-15)
    np.testing.assert_allclose(mesh.nodes[mesh.lower_face, 1], 0.0, atol=0)
    np.testing.assert_allclose(mesh.nodes[mesh.upper_face, 1], 3e-3, rtol=1e-15)
    np.testing.assert_allclose(mesh.nodes[mesh.side, 0], 2e-3, rtol=1e-15)
    assert mesh.on_axis.sum() == 6
    for nodes, column in ((mesh.lower_face, 0), (mesh.upper_face, 0), (mesh.side, 1)):
        assert (np.diff(mesh.nodes[nodes, column]) > 0.0).all()  # axis first; transmission end first
    # The integrand of a ring's volume is linear in R: Gauss points are exact.
    volume = element_geometry(mesh).volume.sum()
    assert volume == pytest.approx(np.pi * 4e-6 * 3e-3, rel=1e-14)


def test_contact_areas_add_up_to_the_faces_and_the_side_between_their_corners() -> None:
    mesh = explicit.cylinder(2e-3, 3e-3, n_radial=3, n_axial=5, grading=2.0)
    area = mesh.contact_area
    for face in (mesh.lower_face, mesh.upper_face):
        assert area[face].sum() == pytest.approx(np.pi * 4e-6, rel=1e-14)
    # N R is linear in y along the side, so its corners would have half of the elements they end.
    half = 0.5 * (np.diff(mesh.nodes[mesh.side, 1])[[0, -1]]).sum()
    side = 2.0 * np.pi * 2e-3 * (3e-3 - half)
    assert area[mesh.side[1:-1]].sum() == pytest.approx(side, rel=1e-14)
    # A node's share of a disc: 2 pi times the integral of N R, here of the node on the axis.
    radius = mesh.nodes[mesh.lower_face[1], 0]
    assert area[mesh.lower_face[0]] == pytest.approx(np.pi * radius**2 / 3.0, rel=1e-14)
    assert (area > 0.0).sum() == 2 * 4 + 4  # none inside


def test_grading_is_the_ratio_of_the_largest_to_the_smallest_element() -> None:
    mesh = explicit.cylinder(1.0, 1.0, n_radial=6, n_axial=7, grading=3.0)
    r = np.diff(mesh.nodes[mesh.lower_face, 0])
    y = np.diff(mesh.nodes[mesh.side, 1])
    assert r[0] / r[-1] == pytest.approx(3.0, rel=1e-12)
    assert y.max() / y.min() == pytest.approx(3.0, rel=1e-12)
    np.testing.assert_allclose(y, y[::-1], rtol=1e-12)  # both faces alike


def test_corners_of_a_node_are_all_its_corners_in_ascending_order() -> None:
    mesh = explicit.cylinder(1.0, 1.0, n_radial=3, n_axial=2)
    start, corner = mesh.corners_of_node
    for node in range(mesh.n_nodes):
        mine = corner[start[node] : start[node + 1]]
        assert list(mine) == sorted(np.flatnonzero(mesh.quads.ravel() == node))


def test_a_clockwise_element_is_named() -> None:
    good = explicit.cylinder(1e-3, 1e-3, n_radial=2, n_axial=2)
    quads = good.quads.copy()
    quads[3] = quads[3, ::-1]
    bad = explicit.Mesh(good.nodes, quads, good.lower_face, good.upper_face, good.side)
    with pytest.raises(
        ValueError, match=r"element 3 has Jacobian .* <= 0: number its corners counter-clockwise"
    ):
        element_geometry(bad)


def test_a_model_starts_when_its_motions_do_and_stands_rigid() -> None:
    found = model(motions=(motion(start=0.25), motion(start=0.25)))
    assert found.start == 0.25
    assert found.support is explicit.RIGID
    assert (explicit.RIGID.impedance, explicit.RIGID.round_trip) == (float("inf"), float("inf"))


@pytest.mark.parametrize("wrong", [0.0, -1.0, float("nan")])
@pytest.mark.parametrize("name", ["impedance", "round_trip"])
def test_a_bar_needs_positive_numbers(name: str, wrong: float) -> None:
    good = explicit.CharacteristicBar(impedance=6910.0, round_trip=617e-6)
    with pytest.raises(ValueError, match=f"{name} must be > 0 .*, got {wrong}"):
        replace(good, **{name: wrong})


# Samples ---------------------------------------------------------------------------------------------


def test_samples_broadcast_scalars_to_the_longest_parameter() -> None:
    samples = explicit.Samples.of(
        stiffness_factor=np.array([0.9, 1.0, 1.1]), friction=0.3, motion=np.array([0, 1, 0])
    )
    assert len(samples) == 3
    np.testing.assert_array_equal(samples.friction, [0.3, 0.3, 0.3])
    np.testing.assert_array_equal(samples.motion, [0, 1, 0])
    assert len(explicit.Samples.of(material=np.array([0, 1]))) == 2


def test_samples_of_different_lengths_are_refused() -> None:
    with pytest.raises(ValueError, match="shape mismatch"):
        explicit.Samples.of(stiffness_factor=np.ones(3), friction=np.ones(2))
    three = explicit.Samples.of(stiffness_factor=np.ones(3))
    with pytest.raises(ValueError, match="one value per sample"):
        replace(three, friction=np.zeros(2))


def test_bulk_modulus_is_that_of_linear_elasticity() -> None:
    # K = E / (3 (1 - 2 nu)) with E = 2 mu (1 + nu), written with other constants than the code's.
    mu, nu = 3.0e4, np.array([0.0, 0.25, 0.495])
    np.testing.assert_allclose(bulk_modulus(mu, nu), 2 * mu * (1 + nu) / (3 * (1 - 2 * nu)), rtol=1e-14)
    assert bulk_modulus(1.0, 0.125) == pytest.approx(1.0, rel=1e-14)  # K = mu at nu = 1/8


# Sampling and stepping ---------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["force_times", "surface_times"])
@pytest.mark.parametrize("times", [[], [0.0, 0.0], [1.0, 0.5], [0.0, float("nan")], [0.0, float("inf")]])
def test_times_must_ascend_and_be_finite(name: str, times: list[float]) -> None:
    good = {"force_times": np.array([0.1]), "surface_times": np.array([0.1])}
    with pytest.raises(ValueError, match=f"{name} must be finite and strictly ascending"):
        explicit.Sampling(**(good | {name: np.array(times)}))


def test_sampling_ends_with_its_last_time() -> None:
    assert explicit.Sampling(np.array([0.1, 0.4]), np.array([0.2])).end == 0.4


# Motion ------------------------------------------------------------------------------------------------


def test_a_motion_is_exact_for_a_cubic_and_goes_on_at_its_last_velocity() -> None:
    def place(t: Any) -> Any:
        return 2.0 * t + 3.0 * t**2 - t**3

    def speed(t: Any) -> Any:
        return 2.0 + 6.0 * t - 3.0 * t**2

    found = explicit.PlatenMotion.sampled(place, speed, start=0.0, end=1.0, n_knots=4)
    times = np.linspace(0.0, 1.0, 31)
    np.testing.assert_allclose(found(times), place(times), atol=1e-14)  # Hermite cubics contain it
    late = np.array([1.0, 1.5, 3.0])
    np.testing.assert_allclose(found(late), place(1.0) + speed(1.0) * (late - 1.0), rtol=1e-13)
    assert found.end == pytest.approx(1.0, rel=1e-15)
    found = explicit.PlatenMotion.sampled(lambda t: 5.0 + t, lambda t: np.ones_like(t), start=2.0, end=3.0)
    assert found.position[0] == 0.0
    assert found(np.array([2.5]))[0] == pytest.approx(0.5, rel=1e-13)


@pytest.mark.parametrize("n_knots", [2, 3, 9])
def test_the_cubics_of_a_motion_are_those_of_hermite_and_a_straight_line_follows(n_knots: int) -> None:
    rng = np.random.default_rng(n_knots)
    position, velocity = rng.uniform(0.0, 5e-3, n_knots), rng.uniform(-3.0, 3.0, n_knots)
    position[0] = 0.0
    found = explicit.PlatenMotion(start=2e-4, step=1e-3, position=position, velocity=velocity)
    knots = 2e-4 + 1e-3 * np.arange(n_knots)
    spline = CubicHermiteSpline(knots, position, velocity)
    expected = spline.c[::-1].T * 1e-3 ** np.arange(4)  # SciPy has the highest power first
    assert found.cubics.shape == (n_knots, 4)
    atol = 1e-15 * 20 * 5e-3  # twenty roundings
    np.testing.assert_allclose(found.cubics[:-1], expected, rtol=0, atol=atol)
    np.testing.assert_allclose(found.cubics[-1], [position[-1], velocity[-1] * 1e-3, 0, 0], rtol=0, atol=atol)
    times = np.linspace(knots[0], knots[-1], 101)
    late = knots[-1] + np.array([0.0, 1e-4, 1e-3, 0.7])
    line = position[-1] + velocity[-1] * (late - knots[-1])
    np.testing.assert_allclose(found(times), spline(times), rtol=0, atol=100 * atol)  # round-off of the times
    np.testing.assert_allclose(found(late), line, rtol=1e-12)
    # and as the time loop evaluates it
    kernel = time_loop_kernel(MarlowLaw, "bonded", "frictionless", precision("fp64"))
    Batch = kernel.structs.Batch
    position_at = boundary_functions(
        "bonded", "frictionless", precision("fp64"), kernel.structs
    ).platen_position

    @wp.kernel(module="unique", enable_backward=False)
    def evaluate(batch: Batch, at: wp.array(dtype=wp.float64), there: wp.array(dtype=wp.float64)):
        there[wp.tid()] = position_at(batch, 0, at[wp.tid()])

    where, samples = select_device("cpu"), explicit.Samples.of()
    mine = model(motions=(found,))
    sampling = explicit.Sampling(times, times)
    batch = batch_of(kernel, mine, samples, sampling, explicit.Stepping(), precision("fp64"), where)
    every = np.concatenate([times, late])
    there = wp.zeros(len(every), dtype=wp.float64, device=where)
    wp.launch(
        evaluate, len(every), [batch, wp.array(every, dtype=wp.float64, device=where), there], device=where
    )
    np.testing.assert_allclose(there.numpy(), np.append(spline(times), line), rtol=1e-12, atol=100 * atol)


# Run -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("prepare", "message"),
    [
        (lambda: explicit.run(model(motions=(motion(start=1.0),)), explicit.Samples.of(), _early()),
         "requested time 0.5 s is before the model's start 1 s"),
        (lambda: explicit.run(model(), explicit.Samples.of(material=1), _early()),
         "a sample names material 1, the model has 0 to 0"),
        (lambda: explicit.run(model(), explicit.Samples.of(motion=3), _early()),
         "a sample names motion 3, the model has 0 to 0"),
        (lambda: explicit.run(model(motions=(motion(), motion(n_knots=9))), explicit.Samples.of(), _early()),
         "the motions of a model need equally many knots"),
        (lambda: select_device("cuda:99"), r"device must be one of \['cpu'.*\], got 'cuda:99'"),
        (lambda: precision("fp16"), r"precision must be one of \['fp32', 'fp64'\], got 'fp16'"),
        (lambda: contact_law("glued"), "contact law must be one of .*, got 'glued'"),
        (lambda: element("Q8"), r"element must be one of \['fbar', 'one_point'\], got 'Q8'"),
        (lambda: law_class("hooke"), r"law must be one of \['arruda_boyce', .*'yeoh'\], got 'hooke'"),
        (lambda: model(volumetric="hooke"), "volumetric must be one of .*, got 'hooke'"),
        (lambda: replace(_early(), ledger_every=0), "ledger_every must be >= 1, got 0"),
    ],
)  # fmt: skip
def test_runs_that_cannot_be_are_refused(prepare: Callable[[], Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        prepare()


def _early() -> explicit.Sampling:
    return explicit.Sampling(np.array([0.5]), np.array([0.5]))


def test_every_outcome_has_a_cause_and_a_cure() -> None:
    for outcome in explicit.Outcome:
        assert outcome.cause
        assert outcome.cure
        assert outcome.ok == (outcome is explicit.Outcome.COMPLETED)


DENSITY = 870.0
SIZES = [(2, 2), (4, 6), (9, 7), (16, 22), (33, 9)]


def shuffled(n_radial: int, n_axial: int) -> explicit.Mesh:
    """A cylinder whose nodes and elements are numbered at random."""
    mesh, rng = (
        explicit.cylinder(4.75e-3, 6.5e-3, n_radial=n_radial, n_axial=n_axial),
        np.random.default_rng(7),
    )
    new, elements = rng.permutation(mesh.n_nodes), rng.permutation(mesh.n_elements)
    return explicit.Mesh(
        nodes=mesh.nodes[np.argsort(new)], quads=new[mesh.quads][elements], lower_face=new[mesh.lower_face],
        upper_face=new[mesh.upper_face], side=new[mesh.side],
    )  # fmt: skip


def model_of(mesh: explicit.Mesh) -> explicit.Model:
    motion = explicit.PlatenMotion(start=0.0, step=1.0, position=np.zeros(2), velocity=np.zeros(2))
    return explicit.Model(mesh, DENSITY, (neo_hookean(27e3),), (motion,))


def kernel_of(model: explicit.Model) -> TimeLoopKernel:
    return time_loop_kernel(MarlowLaw, model.faces, model.side, PRECISIONS["fp64"], model.element)


def surface_of(mesh: explicit.Mesh) -> set[int]:
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
    slots = state.on_chip_elements(numbers) if on_chip else mesh.n_elements
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
    output, _ = output_of(kernel_of(model), mesh, 3, explicit.Sampling(times, times), mesh.side, where)
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


def fan(n: int) -> explicit.Mesh:
    """Elements around a node away from the axis: kites between its neighbours and a ring of corners."""
    angle = np.linspace(0.0, 2.0 * np.pi, 2 * n, endpoint=False)
    ring = np.column_stack([2.0 + np.cos(angle), np.sin(angle)])
    nodes = np.vstack([[2.0, 0.0], ring])
    quads = [[0, 1 + 2 * k, 2 + 2 * k, 1 + (2 * k + 2) % (2 * n)] for k in range(n)]
    low, high = int(nodes[:, 1].argmin()), int(nodes[:, 1].argmax())
    side = np.array([low, int(nodes[:, 0].argmax()), high])
    return explicit.Mesh(nodes, np.array(quads), np.array([low]), np.array([high]), side)


def test_a_node_where_five_elements_meet_is_refused() -> None:
    where, numbers = select_device("cpu"), PRECISIONS["fp64"]
    four, five = model_of(fan(4)), model_of(fan(5))
    assert body_of(kernel_of(four), four, numbers, where).n_elements == 4
    with pytest.raises(ValueError, match=r"^at most 4 elements may meet at a node, 5 do at node 0$"):
        body_of(kernel_of(five), five, numbers, where)


def test_what_fits_on_a_chip_has_room_there() -> None:
    fp64, fp32 = PRECISIONS["fp64"], PRECISIONS["fp32"]
    usual, finer = (explicit.cylinder(1.0, 1.0, n_radial=r, n_axial=a) for r, a in ((16, 22), (24, 32)))
    assert fits_on_chip(usual, fp64)
    assert fits_on_chip(usual, fp32)
    assert not fits_on_chip(finer, fp64)  # as docs/speed.md says
    assert fits_on_chip(finer, fp32)
    assert usual.n_elements <= state.ON_CHIP_ELEMENTS < finer.n_elements
    thin = explicit.cylinder(1.0, 1.0, n_radial=2, n_axial=100)
    assert thin.n_elements <= state.ON_CHIP_ELEMENTS
    assert len(surface_of(thin)) > state.ON_CHIP_BOUNDARY
    assert not fits_on_chip(thin, fp64)
    assert CONTROL_SIZE + Total.COUNT * WARPS <= state.ON_CHIP_CONTROL
    fields = 4 * state.ON_CHIP_NODES + 2 * (4 * state.ON_CHIP_ELEMENTS + 1)
    sums, marks = 3 * state.ON_CHIP_BOUNDARY + state.ON_CHIP_CONTROL, state.ON_CHIP_BOUNDARY
    assert 8 * (fields + sums) + 4 * marks <= 48 * 1024  # what a block gets without a request
