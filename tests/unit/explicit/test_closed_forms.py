"""One element and one specimen against closed forms: forces, energies, stable step, Newton's law."""

from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import warp as wp

import explicit
from explicit.arguments import batch_of, body_of, nodal_mass
from explicit.bars import Section, elastic_bar, pulse_on_bars, pulse_on_mesh
from explicit.bars.elastic import mean_about
from explicit.device import select_device
from explicit.materials import LAWS, bulk_modulus
from explicit.mesh import Mesh, element_geometry
from explicit.precision import PRECISIONS
from explicit.time_loop.kernel import time_loop_kernel
from populations.coverage_problem import HEIGHTS, TRUTH_ELEMENTS, TRUTH_GRADING, drawn, middle, simulate
from populations.other_program import thinned

RADIUS, LENGTH, DENSITY, POISSON = 4.75e-3, 6.5e-3, 870.0, 0.49
LAW = LAWS["neo_hookean"].of([25e3])
ELEMENTS = pytest.mark.parametrize("element", ["one_point", "fbar"])
DAMPING = 2.5e-5


def still() -> explicit.PlatenMotion:
    return explicit.PlatenMotion(start=0.0, step=1.0, position=np.zeros(2), velocity=np.zeros(2))


@cache
def block() -> Mesh:
    """Four rectangles a x b of the section; the first lies on the axis."""
    return explicit.cylinder(RADIUS, LENGTH, n_radial=2, n_axial=2)


A, B = 0.5 * RADIUS, 0.5 * LENGTH
VOLUME = np.pi * A**2 * B  # volume of the first one [m^3]


@cache
def evaluator(element: str) -> Callable[..., np.ndarray]:
    """A function of displacements and velocities [r, y] of an element's corners, shape [2, 4]: forces (8),
    omega^2, elastic and hourglass energy, power of the damping."""
    where, numbers = select_device("cpu"), PRECISIONS["fp64"]
    model = explicit.Model(block(), DENSITY, (LAW,), (still(),), element=element)
    loop = time_loop_kernel(type(LAW), model.faces, model.side, numbers, element)
    body = body_of(loop, model, numbers, where)
    samples = explicit.Samples.of(poisson=POISSON, damping=DAMPING)
    once = explicit.Sampling(np.zeros(1), np.zeros(1))
    batch = batch_of(loop, model, samples, once, explicit.Stepping(), numbers, where)
    read_shape, forces, energies = loop.element.read_shape, loop.element.forces, loop.element.energies
    Body, Batch, vec4 = loop.structs.Body, loop.structs.Batch, numbers.vec4

    @wp.kernel(module="unique", enable_backward=False)
    def evaluate(body: Body, batch: Batch, e: int, u: wp.array(dtype=vec4), out: wp.array(dtype=wp.float64)):
        shape, row = read_shape(body.shapes, e, 1), batch.rows[0]
        f_r, f_y, omega_squared, power, _artificial = forces(
            shape, batch.solids[0], row, u[0], u[1], u[2], u[3], 1
        )
        elastic, hourglass, _s = energies(shape, batch.solids[0], row, u[0], u[1])
        for a in range(4):
            out[a] = f_r[a]
            out[4 + a] = f_y[a]
        out[8] = omega_squared
        out[9] = elastic
        out[10] = hourglass
        out[11] = power

    def of(u: np.ndarray, v: np.ndarray, e: int = 0) -> np.ndarray:
        given = wp.array(np.concatenate([u, v]), dtype=vec4, device=where)
        out = wp.zeros(12, dtype=wp.float64, device=where)
        wp.launch(evaluate, 1, [body, batch, e, given, out], device=where)
        return np.asarray(out.numpy().copy())

    return of


REST = np.zeros((2, 4))
OUTER = block().nodes[block().quads[0], 0] > 0.0  # corners that may move outwards


def strained(size: float = 0.05) -> np.ndarray:
    """A deformation with stretch, shear and an hourglass part [m]; corners on the axis stay on it."""
    u = np.random.default_rng(2).uniform(-size, size, (2, 4)) * LENGTH
    u[0] *= OUTER
    return u


@ELEMENTS
def test_forces_are_the_gradient_of_the_energies(element: str) -> None:
    of, u, h = evaluator(element), strained(), 1e-9
    force = of(u, REST)[:8].reshape(2, 4)
    for way, corner in zip(*np.nonzero(np.stack([OUTER, np.ones(4, bool)])), strict=True):
        step = np.zeros((2, 4))
        step[way, corner] = h
        up, down = (of(u + sign * step, REST)[[9, 10]].sum() for sign in (1.0, -1.0))
        # h^2 and the rounding of 1e-5 J over h
        assert force[way, corner] == pytest.approx((up - down) / (2.0 * h), rel=1e-5, abs=1e-6)


def test_hourglass_energy_is_its_share_of_what_one_point_misses() -> None:
    # The bilinear field of the pattern on a rectangle a x b: the mean of its gradient squared is
    # (4 / 3) (1 / a^2 + 1 / b^2), on a ring too, for the weight r is linear.
    delta = 1e-4
    pattern = np.array([[0.0] * 4, [delta, -delta, delta, -delta]])
    missed = 4.0 / 3.0 * (A**-2 + B**-2) * VOLUME * delta**2
    share = explicit.Model(block(), DENSITY, (LAW,), (still(),)).hourglass
    assert evaluator("one_point")(pattern, REST)[10] == pytest.approx(0.5 * share * 25e3 * missed, rel=1e-12)
    assert evaluator("fbar")(pattern, REST)[10] == 0.0


@ELEMENTS
def test_a_small_dilatation_costs_the_bulk_modulus_and_a_stretch_youngs(element: str) -> None:
    of, strain = evaluator(element), 1e-6
    corners = block().nodes[block().quads[0]].T
    bulk = float(bulk_modulus(25e3, POISSON))
    assert of(strain * corners, REST)[9] == pytest.approx(0.5 * bulk * (3.0 * strain) ** 2 * VOLUME, rel=1e-4)
    young = 2.0 * 25e3 * (1.0 + POISSON)
    free = np.diag([-POISSON * strain, strain]) @ corners
    assert of(free, REST)[9] == pytest.approx(0.5 * young * strain**2 * VOLUME, rel=1e-4)


@ELEMENTS
def test_deviatoric_damping_takes_two_eta_d_d(element: str) -> None:
    # Uniaxial and isochoric: D = rate diag(-1/2, 1, -1/2), so 2 beta mu D : D = 3 beta mu rate^2.
    rate, corners = 100.0, block().nodes[block().quads[0]].T
    v = np.diag([-0.5 * rate, rate]) @ corners
    power = evaluator(element)(REST, v)[11]
    assert power == pytest.approx(3.0 * DAMPING * 25e3 * rate**2 * VOLUME, rel=1e-12)


@ELEMENTS
def test_the_step_bound_is_just_above_the_largest_frequency(element: str) -> None:
    of, h = evaluator(element), 1e-9
    mesh = block()
    free = np.stack([OUTER, np.ones(4, bool)]).ravel()
    stiffness = np.zeros((8, 8))
    for j in np.flatnonzero(free):
        step = np.zeros(8)
        step[j] = h
        up, down = (of(sign * step.reshape(2, 4), REST)[:8] for sign in (1.0, -1.0))
        stiffness[:, j] = (up - down) / (2.0 * h)
    mass = np.tile(DENSITY * element_geometry(mesh).corner_volume[0], 2)
    modes = np.linalg.eigvals((stiffness / mass[:, None])[np.ix_(free, free)])
    largest, damped = float(modes.real.max()), of(REST, REST)[8]
    assert 1.0 <= damped / largest < 1.5  # the damping's part included
    # A specimen at rest takes the step 2 / omega of its stiffest element, less the margin.
    stiffest = max(of(REST, REST, e)[8] for e in range(4))
    model = explicit.Model(mesh, DENSITY, (LAW,), (still(),), element=element)
    samples = explicit.Samples.of(poisson=POISSON, damping=DAMPING)
    response = explicit.run(
        model,
        samples,
        explicit.Sampling(np.array([2e-5]), np.array([2e-5])),
        stepping=explicit.Stepping(safety=0.8),
    )
    assert response.smallest_step[0] == pytest.approx(0.8 * 2.0 / np.sqrt(stiffest), rel=1e-12)


def test_lumped_masses_have_the_mass_and_its_centre() -> None:
    mesh = explicit.cylinder(RADIUS, LENGTH, n_radial=4, n_axial=5, grading=2.0)
    mass = nodal_mass(mesh, DENSITY)
    whole = DENSITY * np.pi * RADIUS**2 * LENGTH
    assert mass.sum() == pytest.approx(whole, rel=1e-13)
    y = mesh.nodes[:, 1] - mesh.nodes[:, 1].min()
    assert mass @ y == pytest.approx(0.5 * LENGTH * whole, rel=1e-13)
    # A row sum of N is exact for linear fields only: of r over a disc, the integral is 2 pi R^3 / 3.
    assert mass @ mesh.nodes[:, 0] == pytest.approx(
        DENSITY * LENGTH * 2.0 * np.pi * RADIUS**3 / 3.0, rel=1e-13
    )


TIMES = np.linspace(0.0, 3e-4, 301)[1:]


@cache
def pressed(element: str, contact: str = "coulomb") -> explicit.Response:
    """A disc pressed with everything on: damping of both kinds, friction, a bar with its echoes."""
    path = {"start": 0.0, "end": TIMES[-1]}
    speed = 3.0
    motion = explicit.PlatenMotion.sampled(
        lambda t: speed * t**2 / TIMES[-1], lambda t: 2.0 * speed * t / TIMES[-1], n_knots=65, **path
    )
    model = explicit.Model(
        explicit.cylinder(RADIUS, LENGTH, n_radial=4, n_axial=5), DENSITY, (LAW,), (motion,),
        element=element, faces=contact, side=contact, support=BAR,
    )  # fmt: skip
    samples = explicit.Samples.of(poisson=POISSON, damping=DAMPING, mass_damping=300.0, friction=0.2)
    sampling = explicit.Sampling(TIMES, TIMES, all_nodes=True)
    return explicit.run(model, samples, sampling, stepping=explicit.Stepping(largest_step=2e-7))


BAR = explicit.CharacteristicBar(300.0, 7e-5)
"""Light, and short enough that its far end answers three times within the window."""


@ELEMENTS
def test_every_term_of_the_ledger_is_there_and_impulses_are_integrals(element: str) -> None:
    ledger = pressed(element).energy
    # Second order in the step; each of these terms is ten times the balance's error or more.
    assert ledger.imbalance()[0] < 2e-4
    for name in ("kinetic", "elastic", "damping", "friction"):
        assert getattr(ledger, name)[0, -1] > 2e-3 * ledger.external[0, -1], name
    found = pressed(element)
    for force, impulse in (
        (found.force_flyer[0], found.impulse_flyer[0]),
        (found.force_transmission[0], found.impulse_transmission[0]),
    ):
        summed = np.concatenate([[0.0], np.cumsum(0.5 * (force[1:] + force[:-1]) * np.diff(TIMES))])
        # Trapezoids of a force that rings within a few of these times.
        np.testing.assert_allclose(impulse - impulse[0], summed, atol=2e-3 * np.abs(impulse).max())


def test_newtons_law_of_the_whole_specimen() -> None:
    # Mass-proportional damping pulls with alpha M v; the platens with their forces.
    found, whole = pressed("one_point"), DENSITY * np.pi * RADIUS**2 * LENGTH
    mesh = explicit.cylinder(RADIUS, LENGTH, n_radial=4, n_axial=5)
    y = found.nodes[0, :, :, 1] @ nodal_mass(mesh, DENSITY) / whole
    momentum = whole * np.gradient(y, TIMES)
    given = found.impulse_transmission[0] - found.impulse_flyer[0] - 300.0 * whole * (y - 0.5 * LENGTH)
    inside = slice(2, -2)
    scale = np.abs(found.impulse_flyer).max()
    np.testing.assert_allclose(momentum[inside], given[inside], atol=3e-3 * scale)  # differences of 1 us


def test_a_free_bar_answers_with_every_reflection() -> None:
    # v(t) = F(t) / Z + 2 sum F(t - k T) / Z: a rod whose far end is free.
    found = pressed("one_point", "bonded")  # which never leaves the bar
    assert found.nodes is not None
    mesh = explicit.cylinder(RADIUS, LENGTH, n_radial=4, n_axial=5)
    place = found.nodes[0, :, int(mesh.lower_face[0]), 1]
    force, impulse = found.force_transmission[0], found.impulse_transmission[0]
    moved = impulse.copy()
    for k in range(1, 5):
        moved += 2.0 * np.interp(TIMES - k * BAR.round_trip, TIMES, impulse, left=0.0)
    # The path is the integral of the speed, as the impulse is that of the force. The solver's answer lags by
    # the mass of the nodes on the platen over the impedance, 0.1 us.
    assert np.abs(force).max() > 0.5
    np.testing.assert_allclose(-place, moved / BAR.impedance, atol=1.5e-2 * np.abs(place).max())


STEEL = {"radius": 7.5e-3, "youngs_modulus": 190e9, "density": 8048.0}
PULSE_BAR = Section(0.25, **STEEL)
STEP, N = 1e-6, 181
PULSE_TIMES = STEP * np.arange(N)


def constant(force: float) -> np.ndarray:
    return (force * PULSE_TIMES)[None]


def test_a_constant_force_on_a_bar_moves_its_face_by_force_over_impedance_and_echoes() -> None:
    found = pulse_on_bars([PULSE_BAR], step=STEP, n=N, sensor=0.1, observed=0.05)
    trip = 2.0 * PULSE_BAR.travel_time
    path = 3.0 / PULSE_BAR.impedance * (PULSE_TIMES + 2.0 * np.maximum(PULSE_TIMES - trip, 0.0))
    # The first half step's force comes half a step late: 3 N / Z 0.5 us; travel times are rounded to 0.1 us.
    np.testing.assert_allclose(
        found.histories(constant(3.0), "path")[0], path, atol=3.0 / PULSE_BAR.impedance * 1e-6
    )
    late = 0.05 / PULSE_BAR.wave_speed
    seen = (
        3.0
        / PULSE_BAR.impedance
        * (np.maximum(PULSE_TIMES - late, 0.0) + np.maximum(PULSE_TIMES + late - trip, 0.0))
    )
    seen += 3.0 / PULSE_BAR.impedance * np.maximum(PULSE_TIMES - late - trip, 0.0)
    np.testing.assert_allclose(
        found.histories(constant(3.0), "seen")[0], seen, atol=3.0 / PULSE_BAR.impedance * 1e-6
    )
    section = found.histories(constant(3.0), "section")[0]
    arrival, back = 0.1 / PULSE_BAR.wave_speed, trip - 0.1 / PULSE_BAR.wave_speed
    np.testing.assert_allclose(section[arrival - 2e-6 > PULSE_TIMES], 0.0, atol=1e-9)
    between = (arrival + 2e-6 < PULSE_TIMES) & (back - 2e-6 > PULSE_TIMES)
    np.testing.assert_allclose(section[between], 3.0, rtol=1e-9)
    np.testing.assert_allclose(section[(back + 2e-6 < PULSE_TIMES) & (trip > PULSE_TIMES)], 0.0, atol=1e-9)


def test_a_short_body_accelerates_as_its_mass_and_a_section_carries_what_lies_behind() -> None:
    short = Section(0.02, **STEEL)
    force = np.sin(np.pi * PULSE_TIMES / PULSE_TIMES[-1])
    impulse = np.concatenate([[0.0], np.cumsum(0.5 * STEP * (force[1:] + force[:-1]))])[None]
    found = pulse_on_bars([short], step=STEP, n=N, sensor=0.005)
    speed = np.gradient(found.histories(impulse, "path")[0], STEP)
    np.testing.assert_allclose(
        speed[5:-5], impulse[0, 5:-5] / short.mass, atol=0.02 * impulse.max() / short.mass
    )
    # A free body: behind the section three quarters of the mass are pushed, by three quarters of the force.
    section = found.histories(impulse, "section")[0]
    np.testing.assert_allclose(section, 0.75 * force, atol=0.02)


def test_a_mesh_is_a_bar_where_waves_are_long_and_its_march_in_time_where_not() -> None:
    parts = [Section(0.03, **STEEL), Section(0.05, **(STEEL | {"radius": 5e-3}))]
    force = np.sin(np.pi * PULSE_TIMES / PULSE_TIMES[-1]) ** 2
    impulse = np.concatenate([[0.0], np.cumsum(0.5 * STEP * (force[1:] + force[:-1]))])[None]
    kind = {"step": STEP, "n": N, "sensor": 0.015, "observed": 0.01}
    mesh = pulse_on_mesh(parts, size=5e-3, radius=4e-3, **kind)
    line = pulse_on_bars(parts, **kind)
    for name, size in (("path", 0.03), ("seen", 0.03), ("section", 0.03)):
        a, b = mesh.histories(impulse, name)[0], line.histories(impulse, name)[0]
        np.testing.assert_allclose(a, b, atol=size * np.abs(b).max())  # the neck of the step, the patch
    marched = elastic_bar(parts, size=5e-3, depths=[0.015], marks=[0.01]).integrate(PULSE_TIMES, force, 4e-3)
    for name, values in (
        ("path", marched.path),
        ("seen", marched.seen[:, 0]),
        ("section", marched.section_force[:, 0]),
    ):
        found = mesh.histories(impulse, name)[0]
        wanted = np.interp(PULSE_TIMES, marched.times, values)
        np.testing.assert_allclose(found, wanted, atol=3e-3 * np.abs(wanted).max())


def test_the_pulses_have_the_impulse_and_nothing_presses_after_a_simulation_is_lost() -> None:
    impulse = np.array([[0.0, 1.0, 3.0, 6.0, 6.5], [0.0, 2.0, 4.0, np.nan, np.nan]])
    force = mean_about(impulse, 0.5)
    np.testing.assert_allclose(force[0], [0.0, 4.0, 5.0, 3.5, 1.0])
    np.testing.assert_allclose(force[1], [0.0, 6.0, 2.0, 0.0, 0.0])
    whole = force * 0.5
    assert whole[0].sum() - 0.25 * force[0, -1] == pytest.approx(6.5)  # the last one reaches half a step on


def test_more_steps_than_were_run_are_refused() -> None:
    with pytest.raises(ValueError, match="5 steps are requested, the pulse's response has 4"):
        pulse_on_bars([PULSE_BAR], step=STEP, n=4).histories(np.zeros((1, 5)), "path")


FILE = Path(__file__).resolve().parents[2] / "reference" / "M_bonded.csv"
NUMBER, SEED = 0, 61
"""Of the experiment in `FILE`; made by `python -m populations.other_program --csv 0 --out FOLDER`."""
RATIO, LOWEST = 1.5, 1.2  # of the meshes' fineness; lowest order of the mesh error that was found


def rms(values):
    return float(np.sqrt(np.mean(values**2)))


@pytest.mark.slow
def test_impact():
    """Mean forces of a twentieth of the test each, and radii at fourteen heights."""
    expected = np.loadtxt(FILE, delimiter=",", skiprows=1)
    assert expected.shape == (20, 1 + len(HEIGHTS))
    setup, truth = drawn(NUMBER, SEED)
    coarse, fine = (
        thinned(
            *middle(
                *(
                    simulate(setup, [truth], mesh=mesh, device="cpu", element=element, grading=TRUTH_GRADING)[
                        0
                    ]
                    for element in TRUTH_ELEMENTS
                )
            )
        )
        for mesh in ((24, 32), (36, 48))
    )
    # Of order 2, with 1.2 at the least (docs/validation/coverage.md): the limit of two meshes is unsure by
    # that, 0.013 N and 1.2 um here. Without damping force and radii differ by 0.29 N and 33 um.
    limit = fine + (fine - coarse) / (RATIO**2 - 1.0)
    unsure = 1.0 / (RATIO**LOWEST - 1.0) - 1.0 / (RATIO**2 - 1.0)
    for part in (np.s_[:, 0], np.s_[:, 1:]):
        assert rms((limit - expected)[part]) < unsure * rms((fine - coarse)[part])
        assert rms((fine - expected)[part]) < RATIO**-LOWEST * rms((coarse - expected)[part])
