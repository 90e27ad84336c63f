"""Contact laws against each other and against what no law may do."""

from dataclasses import dataclass
from functools import cache

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scene import DENSITY, LENGTH, RADIUS, shear_modulus, smooth_stroke, speed_after_rise, table

from explicit import Model, PlatenMotion, Response, Samples, Sampling, cylinder, run
from explicit.materials import neo_hookean

FloatArray = NDArray[np.float64]

TITLE = "Contact laws"
LAWS = ("frictionless", "coulomb", "rough", "bonded")
FRICTION = np.array([0.0, 0.05, 0.1, 0.2, 0.3, 0.5, 0.75, 1.0, 2.0, 10.0, 1e2, 1e3, 1e6])
END = 1.5e-3
TIMES = np.linspace(0.0, END, 301)[1:]
GAP_TOLERANCE = 1e-15
"""Allowed penetration [m]: round-off of a height of 6.5 mm."""
DISSIPATION_TOLERANCE = 1e-8
"""Largest fall of the friction entry between two times [J], 1e-6 of the work: the ledger knows the running
step by half."""


@dataclass(frozen=True)
class Result:
    """One impact to 60 % with every law, and a pull."""

    sweep: Response
    """Coulomb, one row a friction coefficient."""
    smooth: Response
    rough: Response
    bonded: Response
    penetration: dict[str, float]
    """Deepest place of a side node beyond a platen [m], by law."""
    rolled: dict[str, int]
    """Side nodes that lie on the transmission platen at the end, corner included, by law."""
    pull: dict[str, tuple[float, float, float]]
    """Flyer pulled back by 5 %: smallest flyer and transmission force [N], and distance of the flyer-side
    corner from its platen at the end [m], by law."""
    distance: FloatArray
    """Largest force difference from rough over the largest force [-], shape [n_friction]."""


def simulate(law: str, motion: PlatenMotion, friction: FloatArray | float = 0.0) -> Response:
    """Faces and side with one law, 16 × 22 elements, the paper's damping."""
    model = Model(
        cylinder(RADIUS, LENGTH),
        DENSITY,
        (neo_hookean(shear_modulus(0.495)),),
        (motion,),
        faces=law,
        side=law,
    )
    return run(model, Samples.of(poisson=0.495, damping=2.5e-5, friction=friction), Sampling(TIMES, TIMES))


@cache
def case() -> Result:
    """The impact with every law and coefficient, and the pull."""
    push = speed_after_rise(2.6, 50e-6, end=END)
    back = smooth_stroke(-0.05 * LENGTH, 3e-4, end=END)
    runs = {law: simulate(law, push) for law in ("frictionless", "rough", "bonded")}
    runs["coulomb"] = simulate("coulomb", push, FRICTION)
    flyer = LENGTH - push(TIMES)
    penetration, rolled, pull = {}, {}, {}
    for law, response in runs.items():
        height = response.surface_y
        penetration[law] = float(max(-height.min(), (height - flyer[:, None]).max()))
        rolled[law] = int((np.abs(height[-1, -1]) < 1e-9).sum())  # Coulomb: the largest coefficient
        away = simulate(law, back, 0.3)
        gap = LENGTH - back(TIMES[-1:])[0] - away.surface_y[0, -1, -1]
        pull[law] = (float(away.force_flyer.min()), float(away.force_transmission.min()), float(gap))
    rough = runs["rough"].force_transmission[0]
    return Result(
        sweep=runs["coulomb"],
        smooth=runs["frictionless"],
        rough=runs["rough"],
        bonded=runs["bonded"],
        penetration=penetration,
        rolled=rolled,
        pull=pull,
        distance=np.abs(runs["coulomb"].force_transmission - rough).max(axis=1) / rough.max(),
    )


def same_bits(a: Response, b: Response, row: int = 0) -> bool:
    """Whether a row of one response is a single-row response to the last bit."""
    names = ("force_flyer", "force_transmission", "surface_r", "surface_y")
    return all(np.array_equal(getattr(a, name)[row], getattr(b, name)[0]) for name in names)


def row(result: Result) -> tuple[str, str, str]:
    """Line of the index: what is compared, what was measured, what is allowed."""
    bits = same_bits(result.sweep, result.smooth) and same_bits(result.sweep, result.rough, -1)
    return (
        "Coulomb with f = 0 and f = 1e6 against frictionless and rough; penetration of side nodes at 60 %",
        f"{'same bits' if bits else 'DIFFERENT'}; {max(result.penetration.values()):.0e} m",
        f"same bits; {GAP_TOLERANCE:.0e} m",
    )


def draw(result: Result, figure: Figure) -> None:
    """Left: force on the transmission platen by contact law. Right: its impulse (dotted: rough) and the
    energy that friction takes, against the coefficient."""
    left, right = figure.subplots(1, 2)
    time = 1e3 * TIMES
    left.plot(time, result.smooth.force_transmission[0], label="frictionless")
    left.plot(time, result.sweep.force_transmission[4], label="Coulomb, f = 0.3")
    left.plot(time, result.rough.force_transmission[0], label="rough")
    left.plot(time, result.bonded.force_transmission[0], "--", label="bonded")
    left.set(xlabel="time [ms]", ylabel="force [N]")
    left.legend()
    shown = FRICTION <= 2.0
    right.plot(FRICTION[shown], 1e3 * result.sweep.impulse_transmission[shown, -1], "o-", color="C0")
    right.axhline(1e3 * result.rough.impulse_transmission[0, -1], color="C0", linestyle=":", linewidth=0.8)
    right.set(xlabel="friction coefficient f [-]")
    right.set_ylabel("impulse [mN s]", color="C0")
    other = right.twinx()
    other.plot(FRICTION[shown], 1e3 * result.sweep.energy.friction[shown, -1], "s-", color="C1")
    other.set_ylabel("lost to friction [mJ]", color="C1")


def page(result: Result) -> str:
    """The page's text."""
    rows = [
        [
            f"{f:g}",
            f"{1e3 * result.sweep.impulse_transmission[i, -1]:.4f}",
            f"{100 * result.distance[i]:.2g}",
            f"{1e3 * result.sweep.energy.friction[i, -1]:.3f}",
        ]
        for i, f in enumerate(FRICTION)
    ]
    laws = [
        [
            law,
            f"{result.penetration[law]:.0e}",
            str(result.rolled[law]),
            f"{result.pull[law][0]:.2f}",
            f"{result.pull[law][1]:.2f}",
            f"{1e3 * result.pull[law][2]:.3f}",
        ]
        for law in LAWS
    ]
    header = ["f", "impulse [mN s]", "force differs from rough [% of largest]", "lost to friction [mJ]"]
    of_law = [
        "law",
        "penetration [m]",
        "side nodes on the platen at 60 %",
        "pull: smallest flyer force [N]",
        "smallest transmission force [N]",
        "gap at the flyer's corner [mm]",
    ]
    return f"""# {TITLE}

**What is checked.** The laws are one family: Coulomb with f = 0 is the frictionless law and with f towards
infinity the rough one; both must be met to the last bit, although each is generated as a kernel of its own.
No law lets a node through a platen, only the bonded one pulls, and friction only ever takes energy.

**Independent source.** The limits of Coulomb's law and the inequalities of unilateral contact.

**Set-up.** 16 × 22 elements, neo-Hookean, E = 80 kPa, ν = 0.495, damping 2.5e-5 s; 2.6 m/s to
{1e3 * END:g} ms (60 %), the side rolling onto both platens; then a flyer that is pulled back by 5 % within
0.3 ms.

| statement | holds |
| --- | --- |
| f = 0 and frictionless: same bits | {"yes" if same_bits(result.sweep, result.smooth) else "NO"} |
| f = {FRICTION[-1]:g} and rough: same bits | {"yes" if same_bits(result.sweep, result.rough, -1) else "NO"} |

{table(header, rows)}

{table(of_law, laws)}

The bonded faces go into tension, {result.bonded.force_transmission.min():.1f} N in the first waves of the
impact as well; the others lift off, and a pull leaves the specimen at rest.

**Tolerance.** Same bits where two laws coincide. Penetration {GAP_TOLERANCE:.0e} m: round-off of a height.
The friction entry may fall by {DISSIPATION_TOLERANCE:.0e} J between two times, 1e-6 of the work: the ledger
knows the running step by half.
"""
