"""Contact laws at their limits, penetration, and the ledgers of momentum and energy."""

from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure
from numpy.typing import NDArray
from order import FittedOrder, assert_order, fitted_order
from scene import DENSITY, LENGTH, RADIUS, YOUNG, rms, shear_modulus, smooth_stroke, speed_after_rise, table
from test_friction import COARSE, FORCE_TOLERANCE, compress, force_excess

from explicit import Mesh, Model, PlatenMotion, Response, Samples, Sampling, Stepping, cylinder, run
from explicit.materials import neo_hookean
from explicit.mesh import element_geometry

FloatArray = NDArray[np.float64]

END, POISSON, DAMPING = 1.5e-3, 0.495, 2.5e-5
"""End of the impacts at 2.6 m/s, at 60 % [s]; Poisson's ratio [-]; stiffness-proportional damping [s]."""
AREA = np.pi * RADIUS**2  # undeformed area of a face [m^2]
TIMES = np.linspace(0.0, END, 301)[1:]
STEP, N_STEPS = 0.5e-6, 3000
"""Step of the runs for the ledgers [s], below the stable one throughout, and how many there are."""
LAWS: dict[str, dict[str, float]] = {
    "frictionless": {}, "coulomb": {"friction": 0.2}, "penalty": {"friction": 0.2}, "rough": {},
    "bonded_release": {"release_stress": 10e3}, "bonded": {},
}  # fmt: skip
"""The laws, with parameters that make faces stick and slip, or let go."""
STIFFNESS = 10.0 ** np.arange(10.0, 15.1, 0.5)  # penalty stiffnesses [Pa/m]
FRICTION = 2.0 ** np.arange(-1, 13)  # coefficients on the way to infinity [-]
RELEASE = np.array([0.0, 0.3e3, 1e3, 3e3, 10e3, 20e3, 50e3, 100e3, np.inf])
"""Release stresses of the impacts [Pa]."""
PULLED = np.array([0.5e3, 1e3, 2e3, 4e3])  # release stresses of the slow pull [Pa]
QUICK = -0.05 * LENGTH  # stroke of the quick pull [m]
SLOW, DRAG = 20e-3, 400.0
"""Duration of the slow pull and compression [s], and their mass-proportional damping [1/s]."""


def model(
    law: str, motion: PlatenMotion, mesh: tuple[int, int] = (16, 22), poisson: float = POISSON
) -> Model:
    """Faces and side with one law."""
    body = cylinder(RADIUS, LENGTH, n_radial=mesh[0], n_axial=mesh[1])
    return Model(body, DENSITY, (neo_hookean(shear_modulus(poisson)),), (motion,), faces=law, side=law)


@cache
def impact(law: str, **parameters: tuple[float, ...]) -> Response:
    """Impact at 2.6 m/s to 60 %, the side rolling onto both platens."""
    varied = {name: np.array(values) for name, values in parameters.items()}
    samples = Samples.of(poisson=POISSON, damping=DAMPING, **varied)  # type: ignore[arg-type]
    motion = speed_after_rise(2.6, 50e-6, end=END)
    return run(model(law, motion), samples, Sampling(TIMES, TIMES, all_nodes=True))


Ledger = Distance = Result = SimpleNamespace


@cache
def ledger(law: str) -> Ledger:
    """Steps of one size, so that the velocity of each is the difference of two places within it."""
    motion = speed_after_rise(2.6, 50e-6, end=END)
    made = model(law, motion)
    body = made.mesh
    middle = (np.arange(N_STEPS) + 0.5) * STEP  # where the recorded impulses belong to the velocity
    twice = (middle[:, None] + 0.25 * STEP * np.array([-1.0, 1.0])).ravel()
    response = run(
        made,
        Samples.of(poisson=POISSON, damping=DAMPING, **LAWS[law]),  # type: ignore[arg-type]
        Sampling(middle, twice, all_nodes=True),
        stepping=Stepping(largest_step=STEP),
    )
    y = response.nodes[0, :, :, 1]
    mass = np.bincount(
        body.quads.ravel(), DENSITY * element_geometry(body).corner_volume.ravel(), minlength=body.n_nodes
    )
    momentum = (y[1::2] - y[::2]) @ mass / (0.5 * STEP)
    gained = (response.impulse_transmission - response.impulse_flyer)[0]
    flyer = LENGTH - motion(twice)
    energy = response.energy
    work = energy.external[0, -1]
    return Ledger(
        # deepest place of any node beyond a platen [m]
        penetration=float(max(-y.min(), (y - flyer[:, None]).max())),
        # side nodes within 1 um of the transmission platen at the end, corner included
        rolled=int((np.abs(response.surface_y[0, -1]) < 1e-6).sum()),
        # Largest difference between the platens' impulses and the specimen's momentum, over the largest
        # momentum [-].
        momentum=float(np.abs(gained - momentum).max() / np.abs(momentum).max()),
        energy=float(energy.imbalance()[0]),  # largest |external work minus its parts| over external work [-]
        friction=float(energy.friction[0, -1] / work),  # lost to friction over external work at the end [-]
        # lost in landing, or held by the penalty's springs, over external work at the end [-]
        impact=float(energy.impact[0, -1] / work),
        tension=float(response.force_transmission.min()),  # smallest force on the transmission platen [N]
        step=float(response.smallest_step[0]),  # smallest step [s]
    )


def distance(sweep: Response, limit: Response) -> Distance:
    """Distance of every row from a response of one row."""
    force, impulse = limit.force_transmission[0], limit.impulse_transmission[0, -1]
    return Distance(
        # radii of the side nodes, rms over nodes and times [m]
        outline=np.array([rms(radius - limit.surface_r[0]) for radius in sweep.surface_r]),
        # force on the transmission platen, rms over times, over its rms [-]
        force=np.array([rms(row - force) for row in sweep.force_transmission]) / rms(force),
        impulse=np.abs(sweep.impulse_transmission[:, -1] / impulse - 1.0),  # its impulse at the end [-]
    )


def same_bits(sweep: Response, row: int, one: Response) -> bool:
    """Whether a row is a single-row response to the last bit, every node and force at all times."""
    names = ("force_flyer", "force_transmission", "nodes")
    return all(np.array_equal(getattr(sweep, name)[row], getattr(one, name)[0]) for name in names)


def depth(response: Response) -> FloatArray:
    """Deepest place of any node beyond a platen at the recorded times [m], shape [n]."""
    y = response.nodes[..., 1]
    flyer = LENGTH - speed_after_rise(2.6, 50e-6, end=END)(TIMES)
    return np.asarray(np.maximum(-y.min(axis=(1, 2)), (y - flyer[:, None]).max(axis=(1, 2))))


@cache
def quick_pull(law: str) -> Response:
    """Flyer pulled back by 5 % within 0.3 ms, f = 0.3."""
    back = smooth_stroke(QUICK, 3e-4, end=END)
    return run(
        model(law, back), Samples.of(poisson=POISSON, damping=DAMPING, friction=0.3), Sampling(TIMES, TIMES)
    )


@cache
def pull() -> FloatArray:
    """Largest tensile force of a slow pull without lateral contraction, over release stress times area [-],
    columns flyer and transmission platen, rows `PULLED`."""
    times = np.linspace(0.0, SLOW, 4001)[1:]
    back = smooth_stroke(-0.08 * LENGTH, SLOW, end=SLOW)
    samples = Samples.of(poisson=0.0, damping=DAMPING, mass_damping=DRAG, release_stress=PULLED)
    response = run(model("bonded_release", back, (6, 8), 0.0), samples, Sampling(times, times[-1:]))
    forces = np.stack([response.force_flyer, response.force_transmission], axis=-1)
    assert np.array_equal(forces[:, -1], np.zeros((len(PULLED), 2)))  # both faces came off
    return np.asarray(-forces.min(axis=1) / (PULLED * AREA)[:, None])


@cache
def stuck() -> FloatArray:
    """Largest radial displacement of a face that sticks on springs after a slow compression to 20 % [m], rows
    `STIFFNESS`."""
    mesh, response = _pushed(friction=1e3)
    face = mesh.lower_face
    return np.asarray(np.abs(response.nodes[:, -1, face, 0] - mesh.nodes[face, 0]).max(axis=1))


def _pushed(**parameters: float) -> tuple[Mesh, Response]:
    """A slow compression to 20 % on springs, rows `STIFFNESS`."""
    end = np.array([SLOW])
    made = model("penalty", smooth_stroke(0.2 * LENGTH, SLOW, end=SLOW), (6, 8))
    samples = Samples.of(
        poisson=POISSON, damping=DAMPING, mass_damping=DRAG, contact_stiffness=STIFFNESS, **parameters
    )
    return made.mesh, run(made, samples, Sampling(end, end, all_nodes=True))


@cache
def twice() -> tuple[FloatArray, FloatArray]:
    """Slowly pulled by 5 % of the length, pressed by 5 % and pulled again, bonded and letting go at 1 kPa:
    smallest and largest force of the flyer [N], rows first pull, push, second pull."""
    stroke, turn, times = 0.05 * LENGTH, 3.0 * np.pi / SLOW, np.linspace(0.0, SLOW, 1201)[1:]
    wave = PlatenMotion.sampled(
        lambda t: -stroke * np.sin(turn * t) ** 3,
        lambda t: -3.0 * turn * stroke * np.sin(turn * t) ** 2 * np.cos(turn * t),
        start=0.0,
        end=SLOW,
        n_knots=3001,
    )
    made = model("bonded_release", wave, (6, 8))
    samples = Samples.of(
        poisson=POISSON, damping=DAMPING, mass_damping=DRAG, release_stress=np.array([np.inf, 1e3])
    )
    force = run(made, samples, Sampling(times, times[-1:])).force_flyer
    bonded, released = (np.array([[part.min(), part.max()] for part in np.split(row, 3)]) for row in force)
    return bonded, released


@cache
def press() -> FloatArray:
    """Penetration of a face's nodes times stiffness over pressure after a slow frictionless compression to
    20 % [-], rows `STIFFNESS`, columns nodes of the face on the transmission platen."""
    mesh, response = _pushed()
    pressure = response.force_transmission[:, -1] / AREA
    return np.asarray(-response.nodes[:, -1, mesh.lower_face, 1] * (STIFFNESS / pressure)[:, None])


FIGURE_SIZE = (6.7, 4.8)
GAP_TOLERANCE = 1e-15  # allowed penetration of the kinematic laws [m]: round-off of a height of 6.5 mm
PENALTY_GAP_TOLERANCE = 1e-6  # allowed penetration of the penalty law with its default stiffness [m]
MOMENTUM_TOLERANCE = 1e-11
"""Round-off [-]: places of 6.5 mm, known to 1e-18 m, differ by 0.6 um within half a step."""
ENERGY_TOLERANCE = 1e-3  # as in `energy.py` [-]
FITTED = STIFFNESS >= 1e12
"""Stiffnesses of the fitted order: the softer ones add a mode of their own to the impact."""
ORDER_TOLERANCE = 0.05  # allowed distance of the penalty's order from 1
SLIPPING = FRICTION <= 64.0  # coefficients of the fitted order in 1/f: beyond, single landings decide
FRICTION_ORDER = 0.7
"""Smallest order in 1/f, less its scatter: theory gives 1, sticking and slipping of single nodes scatter."""
PULL_TOLERANCE = 0.03
"""Allowed shortfall of the force at release [-]: half of the largest strain, 5 %, within which the stress is
uniform."""
PRESS_TOLERANCE = 5e-4
"""Allowed difference of penetration and pressure over stiffness [-]: what still moves after 20 ms."""

STATIC_TOLERANCE = 1e-4
"""Allowed difference of the force of a slow loading between penalty and kinematic law [-]: a penetration of
0.05 um on each side shortens 2.6 mm by 4e-5."""


@cache
def case() -> Result:
    """All impacts, the pull and the static compression (some seconds)."""
    rough = impact("rough")
    penalty = impact("penalty", friction=(0.3,), contact_stiffness=tuple(STIFFNESS))
    return Result(
        ledgers={law: ledger(law) for law in LAWS},  # every step of an impact, by law
        # from the kinematic Coulomb law with the same coefficient, by `STIFFNESS`
        penalty=distance(penalty, impact("coulomb", friction=(0.3,))),
        depth=depth(penalty),  # penetration [m], by `STIFFNESS`
        # from the rough law, by `FRICTION`
        friction=distance(impact("coulomb", friction=tuple(FRICTION)), rough),
        release=impact("bonded_release", release_stress=tuple(RELEASE)),  # Impacts, by `RELEASE`
        rough=rough,  # the law that release stress 0 must be
        bonded=impact("bonded"),  # the law that an infinite release stress must be
        pull=pull(),  # force at release over its closed form [-], rows `PULLED`
        press=press(),  # penetration over its closed form [-], rows `STIFFNESS`
    )


def orders(result: Result) -> dict[str, FittedOrder]:
    """Orders of the penalty in 1/k, by what is measured."""
    soft = 1.0 / STIFFNESS[FITTED]
    errors = {**vars(result.penalty), "penetration": result.depth}
    return {name: fitted_order(soft, error[FITTED]) for name, error in errors.items()}


def order_of_friction(result: Result) -> FittedOrder:
    """Order of the outline's distance from rough in 1/f."""
    return fitted_order(1.0 / FRICTION[SLIPPING], result.friction.outline[SLIPPING])


def draw(result: Result, figure: Figure) -> None:
    """Draw the figure of the page."""
    (left, right), (waves, pulled) = figure.subplots(2, 2)
    left.loglog(STIFFNESS, 1e6 * result.depth, "o-", label="penetration, largest")
    left.loglog(STIFFNESS, 1e6 * result.penalty.outline, "s-", label="outline, rms")
    left.loglog(
        STIFFNESS, 1e6 * result.depth[-1] * STIFFNESS[-1] / STIFFNESS, ":", color="0.4", label="order 1"
    )
    left.axhline(1.0, color="0.7", linewidth=0.7)
    left.set(xlabel="penalty stiffness [Pa/m]", ylabel="distance [µm]")
    left.legend()
    slips = result.friction.outline > 0.0
    right.loglog(FRICTION[slips], 1e6 * result.friction.outline[slips], "s-", label="outline, rms")
    guide = result.friction.outline[SLIPPING][2] * FRICTION[2] / FRICTION[slips]
    right.loglog(FRICTION[slips], 1e6 * guide, ":", color="0.4", label="order 1")
    right.set(xlabel="friction coefficient f [–]", ylabel="distance from rough [µm]")
    right.legend()
    first = TIMES <= 0.5e-3
    chosen = {len(RELEASE) - 1: "bonded", 7: "100 kPa", 6: "50 kPa", 4: "10 kPa", 0: "rough"}
    for style, (i, label) in zip(("-", "--", "-.", ":", "-"), chosen.items(), strict=True):
        waves.plot(1e3 * TIMES[first], result.release.force_transmission[i, first], style, label=label)
    waves.set(xlabel="time [ms]", ylabel="force on the transmission platen [N]")
    waves.legend()
    closed = PULLED * AREA
    pulled.plot(1e-3 * PULLED, closed, "-", color="0.4", label="stress × area")
    pulled.plot(1e-3 * PULLED, result.pull[:, 0] * closed, "o", label="flyer")
    pulled.plot(1e-3 * PULLED, result.pull[:, 1] * closed, "x", label="transmission platen")
    pulled.set(
        xlabel="release stress [kPa]", ylabel="largest tensile force [N]", xlim=(0, None), ylim=(0, None)
    )
    pulled.legend()


SET = {"friction": "f = {:g}", "release_stress": "{:g} Pa"}  # how a law's parameter is written


def ledgers(result: Result) -> str:
    """Every step of an impact, by law."""
    rows = [
        [
            ", ".join([law.replace("_", " "), *(SET[name].format(x) for name, x in LAWS[law].items())]),
            f"{1e6 * entry.penetration:.2g}",
            str(entry.rolled),
            f"{entry.momentum:.0e}",
            f"{100 * entry.energy:.4f}",
            f"{100 * entry.friction:.2f}",
            f"{100 * entry.impact:.2f}",
            f"{entry.tension:.2f}",
        ]
        for law, entry in result.ledgers.items()
    ]
    header = [
        "law", "deepest node [µm]", "side nodes on the platen", "momentum [-]", "energy [% of work]",
        "friction [% of work]", "impact [% of work]", "smallest force [N]",
    ]  # fmt: skip
    return table(header, rows)


def penalty(result: Result) -> str:
    """Distance of the penalty law from the kinematic one."""
    d, fits = result.penalty, orders(result)
    rows = [
        [
            f"{k:.0e}", f"{1e6 * result.depth[i]:.2g}", f"{1e6 * d.outline[i]:.2g}",
            f"{100 * d.force[i]:.2g}", f"{100 * d.impulse[i]:.2g}",
        ]
        for i, k in enumerate(STIFFNESS)
        if i % 2 == 0
    ]  # fmt: skip
    names = ("penetration", "outline", "force", "impulse")
    rows.append(["order in 1/k", *(f"{fits[n].order:.3f} ± {fits[n].standard_error:.3f}" for n in names)])
    header = ["k [Pa/m]", "deepest node [µm]", "outline, rms [µm]", "force, rms [%]", "impulse [%]"]
    return table(header, rows)


def friction(result: Result) -> str:
    """Distance of Coulomb's law from the rough one."""
    d = result.friction
    rows = [
        [f"{f:g}", f"{1e6 * d.outline[i]:.2g}", f"{100 * d.force[i]:.2g}", f"{100 * d.impulse[i]:.2g}"]
        for i, f in enumerate(FRICTION)
        if i % 2 == 1
    ]
    return table(["f", "outline, rms [µm]", "force, rms [%]", "impulse [%]"], rows)


def shown(result: Result) -> dict[str, object]:
    """What the page and the index show beside the fields of the result."""
    fit = order_of_friction(result)
    last = FRICTION[result.friction.outline > 0.0].max()
    slope = f"{fit.order:.2f} ± {fit.standard_error:.2f}"
    worst = np.abs(result.press - 1.0).max()
    bonded, released = twice()
    kinematic = max(entry.penetration for law, entry in result.ledgers.items() if law != "penalty")
    fits = [fit.order for fit in orders(result).values()]
    ends = same_bits(result.release, 0, result.rough) and same_bits(result.release, -1, result.bonded)
    return locals()


@pytest.mark.parametrize("law", LAWS)
def test_gap_momentum_and_energy_of_every_step(law: str) -> None:
    entry = ledger(law)
    assert entry.rolled >= 2 or law == "frictionless"  # the side has rolled on: there is something to test
    assert entry.penetration < (PENALTY_GAP_TOLERANCE if law == "penalty" else GAP_TOLERANCE)
    assert entry.step == STEP  # steps of one size: places within a step give its velocity
    assert entry.momentum < MOMENTUM_TOLERANCE
    assert entry.energy < ENERGY_TOLERANCE
    if law in ("coulomb", "penalty"):
        assert entry.friction > 0.01  # it did slip
    assert entry.friction > -ENERGY_TOLERANCE


@pytest.mark.parametrize("measure", ["outline", "force", "impulse", "penetration"])
def test_the_penalty_converges_to_the_kinematic_law(measure: str) -> None:
    errors = {**vars(case().penalty), "penetration": case().depth}
    assert_order(1.0 / STIFFNESS[FITTED], errors[measure][FITTED], 1.0, ORDER_TOLERANCE)


def test_the_penalty_penetrates_by_pressure_over_stiffness() -> None:
    np.testing.assert_allclose(press(), 1.0, rtol=0.0, atol=PRESS_TOLERANCE)


def test_a_sticking_face_moves_by_shear_over_stiffness_and_does_not_creep() -> None:
    # some of the modulus at 20 %; a face that creeps would move a hundred times more
    shear = stuck() * STIFFNESS
    assert (shear > 0.05 * YOUNG).all()
    assert (shear < 0.5 * YOUNG).all()
    np.testing.assert_allclose(shear, shear[-1], rtol=0.02)  # 1.5 um of 4.75 mm at the softest: other terms


def test_coulomb_leads_from_frictionless_to_rough_to_the_last_bit() -> None:
    smooth, sweep = (impact("coulomb", friction=(0.0,)), impact("coulomb", friction=tuple(FRICTION)))
    assert same_bits(smooth, 0, impact("frictionless"))
    assert same_bits(sweep, -1, impact("rough"))
    # From the coefficient on at which every pressed node sticks, nothing is left to grow.
    impulse = sweep.impulse_transmission[:, -1]
    assert smooth.impulse_transmission[0, -1] < impulse[0]
    assert (np.diff(impulse[SLIPPING]) > 0.0).all()


@pytest.mark.parametrize("law", ["frictionless", "coulomb", "rough", "bonded"])
def test_only_bonded_faces_carry_tension(law: str) -> None:
    pulled = quick_pull(law)
    gap = LENGTH - QUICK - pulled.surface_y[0, -1, -1]
    if law == "bonded":  # a modulus of 80 kPa, a strain of 5 % and inertia: some newtons
        assert pulled.force_flyer.min() < -1.0
        assert pulled.force_transmission.min() < -0.5
        assert abs(gap) < GAP_TOLERANCE
    else:
        assert pulled.force_flyer.min() == pulled.force_transmission.min() == 0.0
        assert gap == pytest.approx(-QUICK, rel=1e-12)  # the specimen stays where it is


def test_coulomb_converges_to_rough() -> None:
    fit = order_of_friction(case())
    assert fit.order - fit.standard_error > FRICTION_ORDER


def test_release_stress_leads_from_rough_to_bonded() -> None:
    result = case()
    assert same_bits(result.release, 0, result.rough)
    assert same_bits(result.release, -1, result.bonded)
    # The more the faces hold, the harder they pull, up to the bonded ones; nothing is the same in between.
    tension = result.release.force_transmission.min(axis=1)
    assert (np.diff(tension) <= 0.0).all()
    assert tension[0] == 0.0
    assert not same_bits(result.release, 5, result.rough)
    assert not same_bits(result.release, 5, result.bonded)


def test_faces_let_go_at_the_release_stress() -> None:
    # Every node pulls with less than the release stress, so the force stays below stress times area.
    assert (pull() < 1.0).all()
    assert (pull() > 1.0 - PULL_TOLERANCE).all()


def test_what_was_let_go_is_pressed_again_but_never_bonds() -> None:
    bonded, released = twice()
    assert (bonded[[0, 2], 0] < -0.1).all()  # 80 kPa, 5 % and 71 mm^2: 0.28 N
    assert -1e3 * AREA < released[0, 0] < 0.0
    assert released[1, 1] > 0.1
    assert released[2, 0] == 0.0


@pytest.mark.slow
def test_both_formulations_against_the_static_reference() -> None:
    hard, soft = compress(COARSE), compress(COARSE, contact="penalty")
    assert force_excess(soft, "16 × 22") < FORCE_TOLERANCE["16 × 22"]
    for a, b in zip(hard, soft, strict=True):
        assert b.completed
        np.testing.assert_allclose(b.force, a.force, rtol=STATIC_TOLERANCE)
