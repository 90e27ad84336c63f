"""Derivatives by differences: the page; its runs are in `derivatives_runs`."""

from dataclasses import dataclass
from functools import cache
from math import pi, sqrt

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from order import FittedOrder, fitted_order
from scene import (
    DENSITY,
    LENGTH,
    RADIUS,
    gentle_start,
    ninth,
    ninth_slope,
    rms,
    shear_modulus,
    speed_after_rise,
    table,
)

from explicit import Model, Samples, Sampling, Stepping, cylinder
from explicit.adjoint import gradient
from explicit.adjoint.perturbed_runs import Histories, Jacobian, jacobian
from explicit.materials import neo_hookean

FloatArray = NDArray[np.float64]

SMOOTH_END, END = 5e-4, 1.4e-3
"""Ends of the runs [s]: before a node of the side lands, and at 55 % compression."""
LADDER = tuple(10.0 ** (-0.5 * k) for k in range(2, 17))
"""Relative steps from 0.1 to 1e-8."""
PARAMETERS = ("stiffness_factor", "poisson", "damping", "mass_damping")
POINT = {"poisson": 0.495, "damping": 2.5e-5, "mass_damping": 50.0, "friction": 0.3}
MESHES = ((8, 11), (16, 22), (32, 44))
WIDE, BETWEEN = (0.03, 0.02, 0.015), (1e-5, 5e-6, 2.5e-6)
"""Ladders over some landings and between two of them [-]."""
BOTTOM = 1e-7
"""Allowed change of a derivative at the bottom of the V [-]: round-off of 1e-15 over a step of 1e-5, which a
few hundred steps amplify a hundredfold."""
ADJOINT = 1e-7
"""Allowed distance from the adjoint, over the derivative [-]: as the bottom."""
WAVE = 3e-3
"""Allowed rms distance from the closed form of a wave, over the derivative's rms [-]: dispersion, twice what
88 elements along the length have, half of what 44 have."""


@dataclass(frozen=True)
class Secant:
    """Derivatives between two decisions against those over 3 %, by stiffness factor."""

    mesh: str
    """Elements across the radius and along the length."""
    faces: str
    """Contact law of faces and side."""
    impulse: float
    """Rms difference of the transmission impulse's derivative, over its rms [-]."""
    radius: float
    """The same of the side surface's radius."""


@dataclass(frozen=True)
class Result:
    """Everything that the page shows."""

    common: Jacobian
    """Before landing, all runs with the same steps."""
    following: Jacobian
    """The same with steps that follow the deformation."""
    rolling: dict[str, Jacobian]
    """To 55 % with side contact, by contact law."""
    order: dict[str, FittedOrder]
    """Order of the wide side of `common`, by parameter."""
    adjoint: FloatArray
    """Derivatives of one random sum of all histories by the adjoint, by parameter."""
    differences: FloatArray
    """The same from `common`."""
    bound: FloatArray
    """Its error estimate."""
    wave: dict[str, tuple[FloatArray, FloatArray, FloatArray]]
    """Times [s], derivative by m of a force [N] and its closed form [N], by platen."""
    secants: list[Secant]
    """What decisions leave, by mesh and contact law."""

    def wave_error(self, platen: str) -> float:
        """Rms distance from the closed form over the derivative's rms [-]."""
        _, found, exact = self.wave[platen]
        return rms(found - exact) / rms(exact)

    @property
    def adjoint_error(self) -> FloatArray:
        """Distance of the differences from the adjoint [-], by parameter."""
        return np.abs(self.differences / self.adjoint - 1.0)


def impact(end: float, n: tuple[int, int] = (16, 22), law: str = "bonded") -> tuple[Model, Sampling]:
    """A flyer of 2.6 m/s, with one contact law on faces and side."""
    model = Model(
        cylinder(RADIUS, LENGTH, n_radial=n[0], n_axial=n[1]),
        DENSITY,
        (neo_hookean(shear_modulus(0.495)),),
        (speed_after_rise(2.6, 50e-6, end=END),),
        faces=law,
        side=law,
    )
    times = np.linspace(0.0, end, 101)[1:]
    return model, Sampling(times, times[9::10])


def wave() -> dict[str, tuple[FloatArray, FloatArray, FloatArray]]:
    """A plane wave in a rod without lateral motion: F = Z v at the flyer, 2 Z v one transit later.

    With Z = A sqrt(E rho) and the transit L / c both depend on m through c = sqrt(E / rho) ~ sqrt(m).
    """
    speed, rise = 1e-3, 6e-4
    mu = shear_modulus(0.0)
    c = sqrt(2.0 * mu / DENSITY)  # E = 2 mu where Poisson's ratio is 0
    end = 1.9 * LENGTH / c
    model = Model(
        cylinder(RADIUS, LENGTH, n_radial=2, n_axial=88),
        DENSITY,
        (neo_hookean(mu),),
        (gentle_start(speed, rise, end=end),),
        faces="frictionless",
        side="frictionless",
    )
    times = np.linspace(0.0, end, 201)[1:]
    found = jacobian(model, Samples.of(poisson=0.0), Sampling(times, times[-1:])).derivative
    impedance, late = pi * RADIUS**2 * DENSITY * c, times - LENGTH / c
    at_flyer = 0.5 * impedance * speed * ninth(times / rise)
    arrived = 2.0 * impedance * speed
    at_support = arrived * (0.5 * ninth(late / rise) + 0.5 * LENGTH / c / rise * ninth_slope(late / rise))
    return {
        "flyer": (times, found.force_flyer[0], at_flyer),
        "transmission": (times, found.force_transmission[0], at_support),
    }


def secant(n: tuple[int, int], law: str) -> Secant:
    """Compare the derivative between decisions with the one over 3 %."""
    model, sampling = impact(END, n, law)
    close, wide = (
        jacobian(model, Samples.of(**POINT), sampling, relative_steps=ladder).derivative
        for ladder in (BETWEEN, WIDE)
    )

    def distance(name: str) -> float:
        return rms(getattr(close, name) - getattr(wide, name)) / rms(getattr(wide, name))

    return Secant(f"{n[0]} × {n[1]}", law, distance("impulse_transmission"), distance("surface_r"))


def contracted(derivative: Histories, weights: Histories) -> FloatArray:
    """Sum of all entries of a derivative times weights, by parameter."""
    sums = [(f * getattr(weights, name)).reshape(len(f), -1).sum(axis=1) for name, f in derivative.items()]
    return np.sum(sums, axis=0)


@cache
def case() -> Result:
    """All runs: about 300 simulations of 16 × 22 elements, and a dozen of 32 × 44."""
    model, sampling = impact(SMOOTH_END)
    point = Samples.of(**POINT)
    common = jacobian(model, point, sampling, parameters=PARAMETERS, relative_steps=LADDER)
    following = jacobian(
        model, point, sampling, parameters=PARAMETERS, relative_steps=LADDER, stepping=Stepping()
    )
    rng = np.random.default_rng(1)
    weights = common.nominal.map(lambda f: rng.standard_normal(f.shape) / np.abs(f).max())
    found = gradient(model, point, sampling, lambda h: (0.0, weights), stepping=common.stepping)
    rolling = {}
    for law in ("bonded", "coulomb"):
        rolled, times = impact(END, law=law)
        rolling[law] = jacobian(rolled, point, times, relative_steps=LADDER)
    # The wide side, clear of the bottom: where the change is above 1e-7.
    order = {}
    for p, name in enumerate(PARAMETERS[:3]):
        change = common.study.change[p]
        fall = np.arange(len(change)) < np.argmax(change < 1e-7)
        fall[0] = False  # a step of 10 % is not small
        order[name] = fitted_order(common.study.step[p, :-1][fall], change[fall])
    return Result(
        common=common,
        following=following,
        rolling=rolling,
        order=order,
        adjoint=np.array([getattr(found, name) for name in PARAMETERS]),
        differences=contracted(common.derivative, weights),
        bound=contracted(common.error, weights.map(np.abs)),
        wave=wave(),
        secants=[secant(n, law) for law in ("bonded", "coulomb") for n in MESHES],
    )


__all__ = ["FIGURE_SIZE", "TITLE", "Result", "case", "draw", "page", "row"]

TITLE = "Derivatives by differences"
FIGURE_SIZE = (6.7, 3.1)
STEPS = np.array(LADDER[:-1])


def row(result: Result) -> tuple[str, str, str]:
    """Line of the index: what is compared, what was measured, what is allowed."""
    bottom = result.common.study.change.min(axis=1)
    waves = [result.wave_error(platen) for platen in result.wave]
    return (
        "bottom of the V of central differences; the same derivatives by the adjoint; those of a plane wave,"
        " closed form",
        f"{bottom.max():.0e}; {result.adjoint_error.max():.0e}; {100 * max(waves):.2f} %",
        f"{BOTTOM:g}; {ADJOINT:g}; {100 * WAVE:g} %",
    )


def draw(result: Result, figure: Figure) -> None:
    """Change of the derivative by m from one step to the next smaller one. Left: before a node lands; all
    runs with the same time steps, and with steps that follow the deformation. Right: to 55 % with side
    contact, the same time steps."""
    left, right = figure.subplots(1, 2, sharey=True)
    for study, label, marker, line in (
        (result.common.study, "same steps", "o", "-"),
        (result.following.study, "steps that follow", "s", "--"),
    ):
        left.loglog(STEPS, study.force[0], marker + line, color="C0", label=f"forces, {label}")
        left.loglog(STEPS, study.profile[0], marker + line, color="C1", label=f"profile, {label}")
    left.loglog(STEPS[2:9], 0.1 * STEPS[2:9] ** 2, "k:", label="power 2")
    left.loglog(STEPS[9:], 3e-16 / STEPS[9:], "k-.", label="power -1")
    for (law, found), marker, line in zip(result.rolling.items(), "os", ("-", "--"), strict=True):
        right.loglog(STEPS, found.study.force[0], marker + line, color="C0", label=f"forces, {law}")
        right.loglog(STEPS, found.study.profile[0], marker + line, color="C1", label=f"profile, {law}")
    for ax in (left, right):
        ax.set_xlabel("relative step [-]")
        ax.set_xticks(10.0 ** np.arange(-8, 0, 2))
        ax.legend(loc="upper left")
    left.set_ylim(1e-11, 1e3)
    left.set_ylabel("change to the next step [-]")


def page(result: Result) -> str:
    """The page's text."""
    common, following = result.common.study, result.following.study
    chosen = common.chosen
    rows = [
        [
            name,
            f"{common.step[p, chosen[p]]:.1e}",
            f"{common.force[p, chosen[p]]:.0e}, {common.profile[p, chosen[p]]:.0e}",
            f"{result.order[name].order:.3f}" if name in result.order else "",
            f"{following.change[p, 4]:.0e}",
            f"{common.change[p, 4]:.0e}",
            f"{result.adjoint_error[p]:.0e}",
            f"{result.bound[p] / abs(result.adjoint[p]):.0e}",
        ]
        for p, name in enumerate(PARAMETERS)
    ]
    header = [
        "parameter",
        "step",
        "bottom: force, profile",
        "order",
        f"at {LADDER[4]:.0e}: steps that follow",
        "same steps",
        "from the adjoint",
        "error estimate",
    ]
    secants = [[s.faces, s.mesh, f"{100 * s.impulse:.1f}", f"{100 * s.radius:.0f}"] for s in result.secants]
    friction = result.rolling["coulomb"].study
    return f"""# {TITLE}

**What is checked.** `explicit.adjoint.perturbed_runs.jacobian` takes central differences at a ladder of steps
in one
batch and chooses the step at the bottom of the V: the change of a derivative from one step to the next must
fall with the square of the step (truncation), and rise with its inverse where round-off takes over. Where
the response is smooth the bottom must be deep; where it is not, the study must say so.

**Independent source.** Reverse differentiation of the time loop ([](adjoint.md)), which shares no
difference with it: a random sum of all histories, by each parameter. A plane wave in a rod without
lateral motion (ν = 0, frictionless): F = Z v(t) at the flyer and 2 Z v(t − L/c) at the support, with Z and c
growing with the square root of m, so that the derivatives by m are Z v/2 and Z v + (L/c) Z v'.

**Set-up.** 16 × 22 elements, neo-Hookean, E = 80 kPa, ν = {POINT["poisson"]:g}, β = {POINT["damping"]:g} s,
α = {POINT["mass_damping"]:g} 1/s, 2.6 m/s after a rise of 50 µs; bonded to {1e3 * SMOOTH_END:g} ms, before a
node of the side lands. All changes are root mean squares over a history, over the derivative's.

{table(header, rows)}

The same time steps for all runs are needed: where each run's steps follow its own deformation, a requested
time passes from one step to the next as the parameter changes, and the differences scatter by per cents at
every useful step. With one constant step, below the bound of all runs, the scatter is gone.

**Plane wave.** 88 elements along the length, 1 mm/s: distance from the closed form
{100 * result.wave_error("flyer"):.3f} % at the flyer, {100 * result.wave_error("transmission"):.2f} % at the
support.

**Landing and sliding.** To {1e3 * END:g} ms (55 %) nodes of the side land, and with Coulomb friction nodes
stick and slip. Which step they do it in is a decision; when it changes between the two runs of a difference
the response has jumped, which adds jump/h to the derivative (right figure). Below the step at which no
decision changes any more, {result.rolling["bonded"].study.step[0, 5]:.0e} bonded and
{friction.step[0, friction.chosen[0]]:.0e} with friction here, the derivative is sharp again, but it is the
one *between two decisions*: the time at which a node lands does not move with the parameter. `study.smooth`
is False for both. Derivatives by m between decisions ({BETWEEN[0]:g} m) against those over {WIDE[0]:g} m:

{table(["contact", "mesh", "transmission impulse [%]", "radius [%]"], secants)}

The impulse hardly notices, and the outline does, less on finer meshes: a bonded node keeps the radius at
which it lands. For an outline with side contact, take a ladder that stays wide, such as {WIDE}: it
averages over landings, and its error estimate says what they leave.

**Tolerance.** Bottom {BOTTOM:g}: round-off of 1e-15 over a step of 1e-5, amplified a hundredfold by the run.
Order 2 within 0.02: a step of 10 % is left out, at 3 % the next term is 0.5 %. Adjoint {ADJOINT:g}, as the
bottom, and within the error estimate. Wave {100 * WAVE:g} %: dispersion, twice what is
left of it here; 44 elements have four times as much.
"""
