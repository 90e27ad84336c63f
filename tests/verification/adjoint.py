"""Gradients by the adjoint: the page; its runs are in `adjoint_runs`."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scene import DENSITY, LENGTH, RADIUS, shear_modulus, speed_after_rise, table

import explicit
from explicit import RIGID, CharacteristicBar, Model, Samples, Sampling, cylinder
from explicit.adjoint import Gradient, Objective, by_curve_stress, by_table, forward_run, gradient
from explicit.adjoint.perturbed_runs import Histories
from explicit.materials import MarlowLaw, marlow_from_curve
from explicit.model import scale_of
from kolsky.inverse.problem import prepare_shot
from kolsky.inverse.settings import Numerics
from kolsky.shot.load import load_shot

FloatArray = NDArray[np.float64]

SHOT = Path(__file__).resolve().parents[2] / "runs" / "open-01"
END = 1.4e-3
"""End of the runs [s]: 55 % compression, with side contact."""
STEPS = 10.0 ** -np.arange(4.0, 6.6, 0.5)
"""Relative steps of the differences: most are below those at which a node lands in another step."""
N_DIRECTIONS = 4
"""Random directions of a table."""
SHORT = 7e-4
"""End of the run with friction and full damping, whose steps are short [s]."""
POINT = {
    "stiffness_factor": 1.1,
    "poisson": 0.495,
    "damping": 2.5e-5,
    "mass_damping": 50.0,
    "friction": 0.3,
}
BAR = CharacteristicBar(impedance=30.0, round_trip=3e-4)
"""A light bar whose end is near: the platen in front of it moves by half a millimetre."""
ALLOWED = 1e-6
"""Allowed distance of a gradient from its difference [-]: round-off of the objective, 1e-15 amplified a
hundredfold by the run, over a step of 1e-6 or more."""
FORWARD = 1e-10
"""Allowed distance from `explicit.run` over the largest value [-]: round-off (fused multiply-adds there, none
here), amplified by contact, and divided by the interval of a step in a force."""
SHOT_POINTS = (2, 8, 15, 30, 50, 62)
"""Points of the quasi-static curve of open-01 whose derivative is checked by differences."""


@dataclass(frozen=True)
class Check:
    """One derivative against its differences."""

    name: str
    """Parameter or direction."""
    value: float
    """By the adjoint [-], by relative change."""
    differences: FloatArray
    """By central differences at `STEPS`."""
    size: float
    """What a distance is compared with: the derivative, or the largest one of its kind [-]."""

    @property
    def error(self) -> FloatArray:
        """Relative distance at each step [-]."""
        return np.abs(self.differences - self.value) / self.size

    @property
    def best(self) -> float:
        """Distance at the step after which the differences change least: chosen without the adjoint [-]."""
        return float(self.error[np.abs(np.diff(self.differences)).argmin()])

    @property
    def allowed(self) -> float:
        """`ALLOWED`, or how far the differences are apart among themselves where they agree second best [-]:
        with sliding contact their bottom may lie higher, and two of them may agree by chance."""
        return max(ALLOWED, float(np.sort(np.abs(np.diff(self.differences)))[1]) / self.size)


@dataclass(frozen=True)
class Scene:
    """What was found for one pair of contact law and element."""

    name: str
    """Contact law, element and damping."""
    n_steps: int
    forward: float
    """Largest distance of a history from `explicit.run`, over its largest value [-]."""
    checks: list[Check]
    """Every derivative."""


@dataclass(frozen=True)
class ShotGradient:
    """The gradient of a shot's force misfit by its quasi-static curve."""

    strain: FloatArray
    """Nominal compressive strain of the points [-], shape [n]."""
    by_stress: FloatArray
    """Derivative of chi-square by the relative change of the stress of each point [-], shape [n]."""
    by_stress_held: FloatArray
    """The same without what a point does to bulk modulus, damping and hourglass control [-], shape [n]."""
    past_data: float
    """Largest share of the specimen's volume that is strained past the curve [-]."""
    checks: dict[int, Check]
    """Some of them against differences, by index of the point."""
    by_factor: float
    """Derivative by m at m = 1 [-]."""
    chi2: float
    """The misfit [-]."""
    n_steps: int


@dataclass(frozen=True)
class Result:
    """Everything that the page shows."""

    scenes: list[Scene]
    """Bonded, on a bar, rough and with friction."""
    shot: ShotGradient
    """open-01 at m = 1."""

    @property
    def worst(self) -> float:
        """Largest distance from the differences [-]."""
        checks = [check for scene in self.scenes for check in scene.checks]
        return max(check.best for check in (*checks, *self.shot.checks.values()))


def curve() -> tuple[FloatArray, FloatArray]:
    """A stiffening compression curve: stretch [-] and nominal stress [Pa]."""
    lam = np.linspace(0.995, 0.3, 41)
    return lam, shear_modulus(0.5) * (lam - lam**-2) * (1.0 + 0.2 * (lam**2 + 2.0 / lam - 3.0))


def scene_model(
    contact: str, element: str, damping: str, *, end: float = END, support: CharacteristicBar = RIGID
) -> tuple[Model, Sampling]:
    """A flyer of 2.6 m/s on 8 × 11 elements of Marlow's law with 33 knots."""
    model = Model(
        cylinder(RADIUS, LENGTH, n_radial=8, n_axial=11),
        DENSITY,
        (marlow_from_curve(*curve(), n_knots=33),),
        (speed_after_rise(2.6, 50e-6, end=END),),
        faces=contact,
        side=contact,
        support=support,
        element=element,
        damping_kind=damping,  # type: ignore[arg-type]
    )
    times = np.linspace(0.0, end, 101)[1:]
    return model, Sampling(times, times[9::10])


def half_square(scale: Histories) -> Objective:
    """Half the sum of squares of all histories, each over its own largest value."""
    size = scale.map(lambda f: np.array(np.abs(f).max()))

    def objective(found: Histories) -> tuple[float, Histories]:
        over = {name: f / getattr(size, name) for name, f in found.items()}
        value = 0.5 * sum(float((f**2).sum()) for f in over.values())
        return value, Histories(**{name: f / getattr(size, name) for name, f in over.items()})

    return objective


def differences(evaluate: Callable[[float], float], steps: FloatArray = STEPS) -> FloatArray:
    """Central differences of a function of a relative change."""
    return np.array([(evaluate(h) - evaluate(-h)) / (2.0 * h) for h in steps])


def parameter_check(
    model: Model,
    sampling: Sampling,
    found: Gradient,
    objective: Objective,
    name: str,
) -> Check:
    """A scalar parameter, by its relative scale."""
    samples = Samples.of(**POINT)
    scale = scale_of(name, POINT[name])

    def evaluate(h: float) -> float:
        moved = replace(samples, **{name: getattr(samples, name) + h * scale})
        return objective(forward_run(model, moved, sampling, steps=found.steps)[0])[0]

    value = getattr(found, name) * scale
    return Check(name, value, differences(evaluate), abs(value))


def table_check(
    model: Model,
    sampling: Sampling,
    found: Gradient,
    objective: Objective,
    rng: np.random.Generator,
    name: str,
) -> Check:
    """A random direction of all nodes of the table, quotients and slopes alike."""
    law = model.materials[0]
    assert isinstance(law, MarlowLaw)
    quotient = rng.standard_normal(len(law.quotient)) * law.quotient
    slope = rng.standard_normal(len(law.slope)) * np.abs(law.slope).max()

    def evaluate(h: float) -> float:
        moved = replace(law, quotient=law.quotient + h * quotient, slope=law.slope + h * slope)
        varied = replace(model, materials=(moved,))
        return objective(forward_run(varied, Samples.of(**POINT), sampling, steps=found.steps)[0])[0]

    by_quotient, by_slope = by_table(found, law)
    value = float(by_quotient @ quotient + by_slope @ slope)
    return Check(name, value, differences(evaluate), abs(value))


def scene(
    contact: str, element: str, damping: str, *, end: float = END, support: CharacteristicBar = RIGID
) -> Scene:
    """Gradient, forward run and differences of one scene."""
    model, sampling = scene_model(contact, element, damping, end=end, support=support)
    samples = Samples.of(**POINT)
    reference = Histories.of(explicit.run(model, samples, sampling)).map(lambda f: f[0])
    objective = half_square(reference)
    found = gradient(model, samples, sampling, objective)
    size = reference.map(np.abs)
    forward = max(
        np.abs(f - getattr(reference, name)).max() / getattr(size, name).max()
        for name, f in found.histories.items()
    )
    names = [name for name in POINT if name != "friction" or contact == "coulomb"]
    checks = [parameter_check(model, sampling, found, objective, name) for name in names]
    rng = np.random.default_rng(3)
    checks += [
        table_check(model, sampling, found, objective, rng, f"table, direction {k + 1}")
        for k in range(N_DIRECTIONS)
    ]
    name = f"{contact}, {element}, {damping}" + (", on a bar" if support is not RIGID else "")
    return Scene(name, len(found.steps), float(forward), checks)


def shot_gradient() -> ShotGradient:
    """chi-square of the force bins of open-01 at m = 1, by its quasi-static curve."""
    shot = load_shot(SHOT)
    prepared = prepare_shot(shot)
    bins, sampling = prepared.observations.bins, prepared.forward.sampling
    model = prepared.forward.model(Numerics(mesh=(16, 22)))
    samples = Samples.of(poisson=shot.model.poisson, damping=shot.model.damping)
    edge = np.searchsorted(sampling.force_times, bins.edges - 1e-9)
    width = np.diff(bins.edges)

    def objective(found: Histories) -> tuple[float, Histories]:
        residual = (np.diff(found.impulse_transmission[edge]) / width - bins.mean) / bins.sigma
        by_bin = 2.0 * residual / bins.sigma / width
        cotangent = found.map(np.zeros_like)
        np.add.at(cotangent.impulse_transmission, edge[1:], by_bin)
        np.add.at(cotangent.impulse_transmission, edge[:-1], -by_bin)
        return float(residual @ residual), cotangent

    found = gradient(model, samples, sampling, objective)
    stretch, stress = shot.curve.stretch, shot.curve.stress
    by_stress = by_curve_stress(found, stretch, stress) * stress

    def check(i: int) -> Check:
        def evaluate(h: float) -> float:
            moved = stress.copy()
            moved[i] *= 1.0 + h
            varied = replace(model, materials=(marlow_from_curve(stretch, moved),))
            return objective(forward_run(varied, samples, sampling, steps=found.steps)[0])[0]

        largest = float(np.abs(by_stress).max())
        return Check(f"point {i}", float(by_stress[i]), differences(evaluate, STEPS[1:4]), largest)

    return ShotGradient(
        strain=1.0 - stretch,
        by_stress=by_stress,
        by_stress_held=by_curve_stress(replace(found, shear_modulus=0.0), stretch, stress) * stress,
        past_data=float(explicit.run(model, samples, sampling).extrapolated_share[0]),
        checks={i: check(i) for i in SHOT_POINTS},
        by_factor=found.stiffness_factor,
        chi2=found.objective,
        n_steps=len(found.steps),
    )


@cache
def case() -> Result:
    """Four scenes of 8 × 11 elements, and open-01 on 16 × 22."""
    return Result(
        scenes=[
            scene("bonded", "one_point", "deviatoric"),
            scene("bonded", "one_point", "deviatoric", support=BAR),
            scene("rough", "one_point", "deviatoric"),
            scene("coulomb", "fbar", "full", end=SHORT),
        ],
        shot=shot_gradient(),
    )


__all__ = ["FIGURE_SIZE", "TITLE", "Result", "case", "draw", "page", "row"]

TITLE = "Gradients by the adjoint"
FIGURE_SIZE = (6.7, 3.0)
SHOWN = {
    "stiffness_factor": "stiffness factor",
    "poisson": "Poisson's ratio",
    "damping": "damping",
    "table, direction 1": "table, direction 1",
    "table, direction 2": "table, direction 2",
}


def row(result: Result) -> tuple[str, str, str]:
    """Line of the index: what is compared, what was measured, what is allowed."""
    forward = max(scene.forward for scene in result.scenes)
    return (
        "gradient by parameters and by random directions of the material table, central differences with the"
        " same steps; forward run in phases against the time loop",
        f"{result.worst:.0e}; {forward:.0e}",
        f"{ALLOWED:g}; {FORWARD:g}",
    )


def draw(result: Result, figure: Figure) -> None:
    """Left: distance of central differences from the gradient by their step, bonded contact. Right: the
    misfit of the force of open-01 at m = 1 by the stress of each point of its quasi-static curve;
    dashed: without what a point does to bulk modulus, damping and hourglass control through the initial
    modulus; circles: by differences."""
    left, right = figure.subplots(1, 2)
    checks = {check.name: check for check in result.scenes[0].checks}
    for (name, label), marker in zip(SHOWN.items(), "os^Dv", strict=True):
        left.loglog(STEPS, checks[name].error, f"{marker}-", label=label)
    left.axhline(ALLOWED, color="0.5", linestyle="--", label="allowed")
    left.set(xlabel="relative step of the differences [-]", ylabel="relative distance [-]")
    left.set_ylim(1e-12, 1e-2)
    left.legend(loc="upper left")
    shot = result.shot
    right.axhline(0.0, color="0.7", linewidth=0.6)
    right.plot(100 * shot.strain, shot.by_stress / shot.chi2, ".-", label="adjoint")
    held = shot.by_stress_held / shot.chi2
    right.plot(100 * shot.strain, held, "--", color="C2", label="the same, initial modulus held")
    points = np.array(list(shot.checks))
    by_difference = [check.differences[1] / shot.chi2 for check in shot.checks.values()]
    right.plot(
        100 * shot.strain[points], by_difference, "o", color="C1", mfc="none", ms=7, label="differences"
    )
    right.set(
        xlabel="nominal compressive strain [%]",
        ylabel=r"$\partial\ln\chi^2/\partial\ln T_i$ [-]",
    )
    right.legend(loc="lower center")


def _table(scene: Scene) -> list[list[str]]:
    return [
        [
            scene.name,
            check.name,
            f"{check.value:.4g}",
            f"{check.best:.0e}",
            ", ".join(f"{e:.0e}" for e in check.error),
        ]
        for check in scene.checks
    ]


def page(result: Result) -> str:
    """The page's text."""
    shot = result.shot
    rows = [line for scene in result.scenes for line in _table(scene)]
    forward = [[scene.name, str(scene.n_steps), f"{scene.forward:.0e}"] for scene in result.scenes]
    points = [
        [f"{100 * shot.strain[i]:.0f}", f"{check.value / shot.chi2:+.5f}", f"{check.best:.0e}"]
        for i, check in shot.checks.items()
    ]
    euler = abs(shot.by_stress.sum() / shot.by_factor - 1.0)
    steps = ", ".join(f"{h:.0e}" for h in STEPS)
    return f"""# {TITLE}

**What is checked.** `explicit.adjoint.gradient` carries the derivative of one number back through every time
step, from all histories at once to the parameters and to every node of the material table. It must be the
derivative of the response that was computed: of the same steps, contact decisions included.

**Independent source.** Central differences of the forward run with the same sequence of steps, at the step
after which the differences change least (chosen without the adjoint). The forward run in phases, one launch
each, is compared with the time loop in one kernel. Euler's identity: scaling every stress of the curve is
scaling m.

**Set-up.** 8 × 11 elements, a stiffening Marlow law with 33 knots, m = {POINT["stiffness_factor"]:g},
ν = {POINT["poisson"]:g}, β = {POINT["damping"]:g} s, α = {POINT["mass_damping"]:g} 1/s,
f = {POINT["friction"]:g}; 2.6 m/s after a rise of 50 µs to {1e3 * END:g} ms (55 %; with friction
{1e3 * SHORT:g} ms), contact of the side surface; a light bar with
Z = {BAR.impedance:g} N s/m and a round trip of {1e3 * BAR.round_trip:g} ms behind one of them. The number is
half the sum of squares of all forces, impulses, radii and heights, each history over its largest value. A
direction of the table changes all quotients and slopes at random. Derivatives are by the relative change of a
parameter ({{py:func}}`explicit.model.scale_of`).

The forward run in phases, largest distance from `explicit.run` over the largest value:

{table(["contact, element, damping", "steps", "distance [-]"], forward)}

Gradient and relative distance of the differences, at the chosen step and by step ({steps}):

{table(["contact, element, damping", "by", "gradient", "distance", "by step"], rows)}

Where a wide step is far off a node lands, sticks or slips in another step of one of its runs; between
decisions the differences fall onto the gradient.

**A field of unknowns.** Shot open-01 (`runs/open-01`), 16 × 22 elements, {shot.n_steps} steps:
$\\chi^2$ of its {{doc}}`force bins <../theory/inverse_method>` at m = 1, by the stress of each of the
{len(shot.strain)} points of its quasi-static curve, in one gradient. The truth is m = 1.12.
Distances over the largest derivative:

{table(["strain [%]", "∂ ln χ²/∂ ln T", "distance"], points)}

The points to 16 % strain weigh most, and nearly all of it is what they do to the initial modulus, which sets
the bulk modulus, the damping and the hourglass control: with that held, none of them exceeds
{np.abs(shot.by_stress_held[:17]).max() / shot.chi2:.2f}. Beyond, each point acts on its own part of the
curve; the last three hold the tangent on which it is continued, and {100 * shot.past_data:.0f} % of the
volume is strained past the data. The sum over all points is {shot.by_stress.sum() / shot.chi2:.6f}, the
derivative by m itself {shot.by_factor / shot.chi2:.6f} (relative difference {euler:.0e}).

**Tolerance.** {ALLOWED:g} of the derivative: the round-off of the number over a step of 1e-6; where the
differences with sliding contact agree no better among themselves, what they are apart. Forward run
{FORWARD:g}: round-off (the time loop fuses multiply-adds), amplified by contact. Euler's identity 1e-8: the
table is carried back to the curve by differences of its own.
"""
