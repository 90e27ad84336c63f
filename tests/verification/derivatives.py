"""Derivatives by differences: the page; its runs are in `derivatives_runs`."""

import numpy as np
from derivatives_runs import (
    ADJOINT,
    BETWEEN,
    BOTTOM,
    END,
    LADDER,
    PARAMETERS,
    POINT,
    SMOOTH_END,
    WAVE,
    WIDE,
    Result,
    case,
)
from matplotlib.figure import Figure
from scene import table

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
