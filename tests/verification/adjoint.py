"""Gradients by the adjoint: the page; its runs are in `adjoint_runs`."""

import numpy as np
from adjoint_runs import (
    ALLOWED,
    BAR,
    END,
    FORWARD,
    POINT,
    SHORT,
    STEPS,
    Result,
    Scene,
    case,
)
from matplotlib.figure import Figure
from scene import table

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
