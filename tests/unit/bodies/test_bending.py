"""Bend, its slope and the inverse of both: closed forms, differences, and known answers."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from kolsky_command import rows_of

from explicit.materials import LAWS
from kolsky.bodies.actuator_bending import SearchEnd, implausible_load, pressures_for
from kolsky.bodies.actuator_control import reduce_actuator
from kolsky.bodies.actuator_model import Actuator, Part, bend_of, bend_slope, forces_outside, touching
from kolsky.bodies.actuator_reading import read_actuator
from kolsky.bodies.specimen_constants import Constants
from kolsky.bodies.specimen_fit import LIMIT, debonding
from kolsky.bodies.specimen_model import Shape, SpecimenModel, strains
from kolsky.equilibrium.meshes import Mesh, grid
from kolsky.equilibrium.model import Fixed, RigidSurface, SelfContact
from kolsky.equilibrium.solid import Isotropic, bulk
from kolsky.equilibrium.solve import Newton
from kolsky.equilibrium.surface_contact import surface_contacts
from tests.unit.bodies.small import DOWN, MOST, actuator

SMALL = actuator()


def test_angle_of_an_arc_is_half_of_its_turn() -> None:
    # the chord of a circular arc that has turned by phi points along phi / 2
    for phi in (-0.6, 0.0, 0.4, 1.5, 3.0):
        radius = 1.0 / phi if phi else 0.0
        chord = np.array([radius * np.sin(phi), 0.0, -radius * (1.0 - np.cos(phi))]) if phi else [1.0, 0, 0]
        assert bend_of(np.asarray(chord)) == pytest.approx(0.5 * phi)


def test_slope_of_the_angle_by_the_chord() -> None:
    chord, h = np.array([0.04, 0.001, -0.03]), 1e-7
    each = [(bend_of(chord + h * e) - bend_of(chord - h * e)) / (2 * h) for e in np.eye(3)]
    assert bend_slope(chord) == pytest.approx(np.array(each), rel=1e-7)


def test_weight_bends_a_beam_down() -> None:
    # without pressure the two directions of gravity bend it oppositely, alike to first order
    down, up = (actuator().simulate((0.0, 0.0, s * 0.05), np.zeros(1)).angle[0] for s in (-1.0, 1.0))
    assert down > 0.0
    assert up == pytest.approx(-down, rel=2e-3)  # O(g): the second order of 0.05 m/s2


def test_slope_is_the_difference_of_angles() -> None:
    tight = Newton(tolerance=1e-11)
    found = SMALL.simulate(DOWN, np.array([20e3, 39.9e3, 40e3, 40.1e3]), newton=tight)
    difference = (found.angle[3] - found.angle[1]) / 200.0
    assert found.slopes()[2, 0] == pytest.approx(difference, rel=1e-6)


def test_newton_finds_the_planted_pressure() -> None:
    planted = SMALL.simulate(DOWN, np.array([17e3, 34e3]))
    found = pressures_for(SMALL, DOWN, angle=float(planted.angle[-1]), most=MOST)
    assert found.ended is SearchEnd.YES
    assert found.pressures[0] == pytest.approx(34e3, rel=1e-3)
    assert found.equilibria <= 6


def test_what_cannot_be_reached_is_said() -> None:
    assert pressures_for(SMALL, DOWN, angle=2.0, most=20e3).ended is SearchEnd.ABOVE
    assert pressures_for(SMALL, DOWN, angle=-0.5, most=20e3).ended is SearchEnd.BELOW


def test_suction_for_a_bend_the_other_way() -> None:
    planted = SMALL.simulate(DOWN, np.array([-5e3, -10e3]))
    assert planted.angle[-1] < SMALL.simulate(DOWN, np.zeros(1)).angle[0]
    found = pressures_for(SMALL, DOWN, angle=float(planted.angle[-1]), most=-20e3)
    assert found.ended is SearchEnd.YES
    assert found.pressures[0] == pytest.approx(-10e3, rel=1e-3)
    assert pressures_for(SMALL, DOWN, angle=0.5, most=-5e3).ended is SearchEnd.BELOW
    assert pressures_for(SMALL, DOWN, angle=-2.0, most=-5e3).ended is SearchEnd.ABOVE


def test_a_pressure_beyond_five_shear_moduli_is_named() -> None:
    assert implausible_load(5e5, 1e5) == []
    assert "6 times the shear modulus" in implausible_load(-6e5, 1e5)[0]


def test_two_chambers_by_bounded_least_squares() -> None:
    pair = actuator(separate=True)
    planted = pair.simulate(DOWN, np.array([[10e3, 20e3], [20e3, 40e3]]))
    assert planted.slopes().shape == (2, 2)
    wanted = {"angle": float(planted.angle[-1]), "tip": planted.chord[-1]}
    found = pressures_for(pair, DOWN, **wanted, most=MOST)
    assert found.ended is SearchEnd.YES
    assert found.pressures == pytest.approx([20e3, 40e3], rel=1e-3)
    capped = pressures_for(pair, DOWN, **wanted, most=30e3)
    assert capped.ended is SearchEnd.NEAREST
    assert capped.pressures.max() <= 30e3


def test_chambers_that_touch() -> None:
    free = actuator(wall=1.2e-3, gap=0.3e-3, cell=4e-3, inlet=2e-3)
    contact = SelfContact("gap_1_left", "gap_1_right")
    both = replace(free, contacts=(contact,))
    pressures = np.array([5e3, 23.9e3, 24.1e3])
    apart, touched = free.simulate(DOWN, pressures), both.simulate(DOWN, pressures)
    assert touched.solution.outcome.ok
    assert touching(apart) is None
    pressed = touching(touched)
    assert pressed is not None
    assert pressed.force[0] == 0.0
    assert pressed.force[2] > 0.01
    # the walls as far through each other as the penalty says: 1 % of a face of 3.6 by 5 mm is what is allowed
    assert 0.0 < pressed.depth[2] < 40e-6
    assert touched.angle[0] == pytest.approx(apart.angle[0], rel=1e-6)
    assert touched.angle[2] > 1.02 * apart.angle[2]  # pushed apart, it bends more
    # half of the actuator is modelled: the pressures of both halves
    u = touched.solution.displacements[2].ravel()
    each = [one.areas @ one.pressures(u) for one in surface_contacts(touched.solution.model)]
    assert pressed.force[2] == pytest.approx(2.0 * sum(each))
    # exact slope in contact
    difference = (touched.angle[2] - touched.angle[1]) / 200.0
    assert touched.slopes()[1:, 0].mean() == pytest.approx(difference, rel=1e-4)
    with pytest.raises(ValueError, match="no contact"):
        reduce_actuator(both, DOWN, most=30e3, modes=3, tolerance=1e-3)


N = 40
X = np.linspace(0.0, 1.0, N)
J = np.stack([X, X**2], -1) * 50.0
SHORT = -20.0 * X
"""Force with bonds shorter by 1 mm, less the force as it is, in standard deviations."""


def test_length_and_deviation_are_those_of_least_squares() -> None:
    opened = np.where(np.arange(N) >= 24, SHORT, 0.0)
    residual = 0.6 * opened + J @ np.array([0.3, -0.1])
    found = debonding(residual, J, SHORT, amount=1e-3, scale=4.0)
    assert found is not None
    assert found.sample == 24
    assert found.length == pytest.approx(0.6e-3)
    # The deviation of one more constant in the fit with J: [(A^T A)^-1] of A = [J, template].
    A = np.column_stack([J, opened])
    assert found.sigma == pytest.approx(1e-3 * np.sqrt(4.0 * np.linalg.inv(A.T @ A)[2, 2]))
    assert found.z == pytest.approx(found.length / found.sigma)
    assert found.searched == round(0.85 * N) - round(0.15 * N)


def test_noise_alone_and_a_bond_that_holds_are_not_suspected() -> None:
    rng = np.random.default_rng(2)
    for _ in range(20):
        found = debonding(rng.standard_normal(N), J, SHORT, amount=1e-3, scale=1.0)
        assert found is not None
        assert not found.suspected
    stiffer = debonding(-np.where(np.arange(N) >= 20, SHORT, 0.0), J, SHORT, amount=1e-3, scale=1.0)
    assert stiffer is not None
    assert not stiffer.suspected  # more force than the model's is no peeling


def test_limit() -> None:
    opened = np.where(np.arange(N) >= 24, SHORT, 0.0)
    unit = debonding(opened, J, SHORT, amount=1e-3, scale=1.0)
    assert unit is not None
    for size, suspected in ((0.95, False), (1.05, True)):
        found = debonding(size * LIMIT / unit.z * opened, J, SHORT, amount=1e-3, scale=1.0)
        assert found is not None
        assert found.suspected is suspected


def test_constants_that_imitate_it_leave_nothing_to_say() -> None:
    assert debonding(np.zeros(N), np.eye(N), SHORT, amount=1e-3, scale=1.0) is None


ROOT = Path(__file__).resolve().parents[3]


@pytest.mark.slow
@pytest.mark.parametrize("gravity", [pytest.param("downward", marks=pytest.mark.long), "upward"])
def test_bend_is_that_of_dolfinx(gravity: str) -> None:
    read = read_actuator(ROOT / "runs" / "actuator" / "pneunet.toml")
    rows = rows_of(ROOT / "tests" / "reference" / "K_pneunet.csv")
    rows = [row for row in rows if row["gravity"] == gravity]
    pressures = sorted({float(row["pressure (Pa)"]) for row in rows})
    assert pressures[1:] == pytest.approx([30e3, 50e3, 76e3])
    run = read.actuator.simulate(read.gravities[gravity], np.array(pressures))
    mesh = read.actuator.mesh
    for step, pressure in enumerate(pressures):
        own = [row for row in rows if float(row["pressure (Pa)"]) == pressure]
        theirs = np.array([[float(row[f"{axis} (m)"]) for axis in "xyz"] for row in own])
        nodes = np.array([int(row["node"]) for row in own])
        ours = mesh.points[nodes] + run.solution.displacements[step, nodes]
        # the same elements and points of quadrature: what both iterations leave, some 1e-8 of the length
        assert np.abs(ours - theirs).max() < 1e-7 * np.ptp(mesh.points[:, 0])
        chord = theirs[-1] - theirs[0]
        assert run.angle[step] == pytest.approx(np.arctan2(-chord[2], chord[0]), rel=1e-6)


LAW = Constants(
    "mooney_rivlin", {"C10": 9e3, "C01": 4e3, "C11": 400.0, "poisson": 0.4}, ("C10", "C01", "poisson")
)
STRIP = Shape("strip", (0.08, 0.02, 0.004), 0.01, (16, 4, 2), element="hex8")
CROSS = Shape("cross", (0.08, 0.08, 0.004), 0.01, (8, 8, 2), arm=0.02, element="hex8")


def test_bonds_are_faces_at_the_ends() -> None:
    mesh = STRIP.mesh
    bond = mesh.points[mesh.nodes("bond_x+")]
    assert bond[:, 0].min() == pytest.approx(0.03)
    assert np.unique(np.round(bond[:, 2], 9)).tolist() == [0.002]
    assert STRIP.multiplicity == 4.0
    whole = Shape("strip", (0.08, 0.02, 0.004), 0.01, (16, 4, 2), element="hex8", gravity=(0.0,) * 3)
    assert len(whole.mesh.nodes("bond_x-")) == 2 * 5 * 3
    assert whole.multiplicity == 1.0


@pytest.mark.parametrize("shape", [STRIP, CROSS])
def test_an_eighth_pulls_like_the_whole(shape: Shape) -> None:
    d = np.repeat(np.array([[0.01], [0.02]]), shape.ends, axis=1)
    whole = replace(shape, gravity=(0.0, 0.0, 0.0))
    a, b = (SpecimenModel("one", s).linearised(LAW, LAW.start, d) for s in (shape, whole))
    assert a.force == pytest.approx(b.force, rel=1e-7)
    assert a.by_constants == pytest.approx(b.by_constants, rel=1e-6)
    assert a.by_displacement == pytest.approx(b.by_displacement, rel=1e-5, abs=1e-6)


def test_slopes_are_those_of_differences() -> None:
    model, d = SpecimenModel("one", CROSS), np.array([[0.01, 0.015]])
    here = model.linearised(LAW, LAW.start, d)
    for j, size in enumerate((10.0, 10.0, 1e-4)):
        moved = [LAW.start + sign * size * (np.arange(3) == j) for sign in (1.0, -1.0)]
        up, down = (model.linearised(LAW, values, d) for values in moved)
        assert here.by_constants[..., j] == pytest.approx((up.force - down.force) / (2.0 * size), rel=1e-4)
    for end in range(2):
        moved = [d + sign * 1e-6 * (np.arange(2) == end) for sign in (1.0, -1.0)]
        up, down = (model.linearised(LAW, LAW.start, at) for at in moved)
        slope = (up.force - down.force) / 2e-6
        assert here.by_displacement[..., end] == pytest.approx(slope, rel=1e-4, abs=1e-3)


def test_samples_may_come_in_any_order() -> None:
    model = SpecimenModel("one", STRIP)
    d = np.array([[0.02], [0.005], [0.01]])
    there, sorted_there = (model.linearised(LAW, LAW.start, x) for x in (d, np.sort(d, axis=0)))
    assert there.force[[1, 2, 0]] == pytest.approx(sorted_there.force, rel=1e-8)


def test_failure_is_said() -> None:
    with pytest.raises(ValueError, match=r"C10|shear modulus"):
        SpecimenModel("one", STRIP).linearised(LAW, np.array([-9e3, 4e3, 0.4]), np.array([[0.01]]))


def test_strains_by_volume() -> None:
    # The whole bonded face is held: volumes add up to the simulated eighth, and the mid-region is stretched
    # by the stroke over the free length or a little more.
    model = SpecimenModel("one", STRIP)
    solution = model.simulate(LAW.solid(LAW.start), np.array([[0.03]]))
    strain, volume = strains(solution, 0)
    assert volume.sum() == pytest.approx(0.08 * 0.02 * 0.004 / 8.0)
    middle = strain[STRIP.mid_region()]
    assert middle[..., 0].mean() == pytest.approx(0.03 / 0.06, rel=0.1)
    # compressible at nu = 0.4, uniform: sides are equal
    assert middle[..., 1].mean() == pytest.approx(middle[..., 2].mean(), abs=0.02)


def test_a_shorter_bond() -> None:
    assert STRIP.shortened().bond == pytest.approx(0.005)
    with pytest.raises(ValueError, match="at least 2"):
        Shape("strip", (0.08, 0.02, 0.004), 0.005, (16, 4, 2)).shortened()


def test_elements_are_added_until_the_bend_is_within_its_bound() -> None:
    options = {"most": MOST, "modes": 5, "seen": 6, "tolerance": 0.2}
    loose = reduce_actuator(SMALL, DOWN, **options)
    bound = 0.2 * loose.largest_error
    tight = reduce_actuator(SMALL, DOWN, **options, within=(np.pi, bound))
    assert tight.largest_error <= bound
    assert len(tight.model.reduced.sample.cells) > len(loose.model.reduced.sample.cells)


SPAN, CAP, LAYER, CLOSED = 0.2, 5e-3, 2e-3, (2e-3, 6e-3)
"""Length, thickness of the closed end and of the stiff layer, heights of the hole of a square bar of 10 mm
with a hole 4 mm wide [m]."""
YOUNG, RATIO, SMALL_PRESSURE = 1e6, 20.0, 200.0
"""Modulus [Pa], that of the layer over it [-]; bends of 2e-4 rad, far inside the range of small ones [Pa]."""


def _linear(young: float) -> Isotropic:
    """A rubber of Poisson's ratio 0: nothing couples the walls' stress across with that along the bar."""
    return Isotropic(LAWS["neo_hookean"].of([0.5 * young]), bulk(young / 3.0))


def _layered(*world: Fixed | RigidSurface) -> Actuator:
    """Half of the bar, clamped at x = 0, with a stiff layer at its bottom."""
    x = np.concatenate([np.linspace(0.0, SPAN - CAP, 7), [SPAN]])
    keep = np.ones((len(x) - 1, 2, 3), dtype=bool)
    keep[:-1, 0, 1] = False
    mesh = grid([x, np.array([0.0, 2e-3, 5e-3]), np.array([0.0, *CLOSED, 10e-3])], keep)
    p, tight = mesh.points, 1e-9
    low, far = p[:, 2] < tight, p[:, 0] > SPAN - tight
    inside = (p[:, 0] < SPAN - CAP + tight) & (p[:, 1] < 2e-3 + tight) & (np.abs(p[:, 2] - 4e-3) < 2.001e-3)
    middle = p[:, 1] < tight
    masks = {
        "clamp": p[:, 0] < tight, "mirror": middle, "cavity": inside, "edge": far & low,
        "origin": (p[:, 0] < tight) & middle & low, "tip": far & middle & low,
    }  # fmt: skip
    sets = {name: np.flatnonzero(mask) for name, mask in masks.items()}
    layer = np.flatnonzero(p[mesh.cells, 2].mean(axis=1) < LAYER)
    part = Part("layer", _linear(RATIO * YOUNG), 3000.0, layer)
    return Actuator(
        Mesh(p, mesh.cells, mesh.kind, sets), ("cavity",), _linear(YOUNG), 1000.0, parts=(part,), world=world
    )


def _beam() -> tuple[float, float]:
    """Deflection of the free end [m] and EI [N m^2] of the layered beam under the pressure on its closed end,
    which acts in the hole's middle."""
    parts = [(10e-3, 0.0, LAYER, RATIO), (10e-3, LAYER, 10e-3, 1.0), (-4e-3, *CLOSED, 1.0)]
    stiff = [(b * (top - low) * e, 0.5 * (low + top), top - low) for b, low, top, e in parts]
    centre = sum(s * z for s, z, _ in stiff) / sum(s for s, *_ in stiff)
    bending = YOUNG * sum(s * (h**2 / 12.0 + (z - centre) ** 2) for s, z, h in stiff)
    moment = SMALL_PRESSURE * 16e-6 * (4e-3 - centre)
    return moment * (SPAN - CAP) * (SPAN - 0.5 * (SPAN - CAP)) / bending, bending


def test_a_layered_bar_bends_presses_and_is_blocked_as_a_beam() -> None:
    deflection, bending = _beam()
    pressure = np.array([SMALL_PRESSURE])
    free = _layered().simulate((0.0, 0.0, 0.0), pressure)
    # 1 %: shear, and the ends of the hole, are (height / length)^2 = 0.25 % and more of the bend
    assert free.solution.mean_displacement("tip")[0, 2] == pytest.approx(-deflection, rel=0.01)
    blocked = deflection * 3.0 * bending / SPAN**3
    held = _layered(Fixed("edge", (2,))).simulate((0.0, 0.0, 0.0), pressure)
    assert forces_outside(held)["edge"][0] == pytest.approx([0.0, 0.0, -blocked], rel=0.01)
    table = RigidSurface("edge", (0.0, 0.0, 2.0), (0.0, 0.0, -0.4 * deflection))
    pressed = _layered(table).simulate((0.0, 0.0, 0.0), pressure)
    assert forces_outside(pressed)["edge"][0] == pytest.approx([0.0, 0.0, -0.6 * blocked], rel=0.015)


def test_every_part_has_its_own_weight_and_scales_alike() -> None:
    one = _layered()
    lying = one.simulate((0.0, 0.0, -1.0), np.zeros(1))  # far above the floor of the residual
    mass = 3000.0 * 10e-3 * LAYER * SPAN + 1000.0 * (80e-6 * SPAN - 16e-6 * (SPAN - CAP))
    assert 2.0 * lying.solution.reaction("clamp")[0, 2] == pytest.approx(mass, rel=1e-6)
    ogden = Isotropic(LAWS["ogden1"].of([2e5, 3.0]), bulk(1e6))
    own = replace(one, solid=ogden, parts=()).constants()
    assert replace(one, solid=ogden, parts=()).constants(2.0) / own == pytest.approx(np.array([[2, 1, 2]]))
    assert one.constants(2.0) == pytest.approx(2.0 * one.constants())
