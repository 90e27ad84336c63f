"""Failure is a result: every way to fail in one batch, its moment, its element, and its neighbours."""

from dataclasses import dataclass
from functools import cache

import numpy as np
from failure_runs import (
    CHECK_EVERY,
    END,
    EXPECTED,
    SHORT,
    STEPPING,
    TIMES,
    WHY,
    Witness,
    bits_of_neighbours,
    model,
    motion_over_work,
    samples,
    witness,
)
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scene import table

from explicit import Outcome, Response, Sampling, run
from explicit.time_loop.element_sweeps import MOTION_LIMIT

FloatArray = NDArray[np.float64]

TITLE = "Failure is a result"
FAILED = [i for i, outcome in enumerate(EXPECTED) if not outcome.ok]
"""Rows of the batch that must fail."""
NEVER = 10**6
"""Steps between two measurements of the step that is measured only once."""
ONSET = 3.0
"""Force by which a diverging run may be wrong before it is ended [N]: what a force measurement resolves."""


@dataclass(frozen=True)
class Result:
    """A batch with every failure, and what was found of it."""

    batch: Response
    """Eight simulations, five of which fail."""
    bits: dict[str, bool]
    """Whether rows keep the bits they have "alone", and the sound ones those of a batch "without" the
    others."""
    witnesses: dict[int, Witness]
    """Each failure looked at again with NumPy, by row."""
    unstable: Response
    """Row 0 with a step that is measured once and never again."""
    astray: float
    """Largest difference of its recorded forces from the sound run's [N]."""
    motion: dict[str, FloatArray]
    """Kinetic energy over the platens' work so far at the times of the batch, to each end [-]."""


@cache
def case() -> Result:
    """Run the batch, its rows alone, and the unstable run."""
    batch = run(model(), samples(list(range(len(EXPECTED)))), Sampling(TIMES, TIMES), stepping=STEPPING)
    unstable, runaway = motion_over_work(0, measure_every=NEVER)
    known = np.isfinite(unstable.force_flyer[0])
    astray = max(
        float(np.abs(getattr(unstable, name)[0] - getattr(batch, name)[0])[known].max())
        for name in ("force_flyer", "force_transmission")
    )
    return Result(
        batch=batch,
        bits=bits_of_neighbours(batch),
        witnesses={i: witness(batch, i) for i in FAILED},
        unstable=unstable,
        astray=astray,
        motion={
            "sound": motion_over_work(0)[1],
            "softening curve": motion_over_work(6)[1],
            "step never measured again": runaway,
        },
    )


def row(result: Result) -> tuple[str, str, str]:
    """Line of the index: what is compared, what was measured, what is allowed."""
    seen = result.witnesses.values()
    right = sum(w.named == w.found for w in seen)
    same = all(result.bits.values()) and all(w.same_history for w in seen)
    return (
        "a batch with every kind of failure: neighbours, histories up to the end, and the element that is "
        "named against node positions",
        f"{'same bits' if same else 'DIFFERENT'}; {right} of {len(result.witnesses)} elements",
        "same bits; all",
    )


def draw(result: Result, figure: Figure) -> None:
    """Left: transmission force of the batch, each simulation to its end (dot), linear below 10 N. Right:
    kinetic energy over the largest work of the platens so far; above the limit a simulation has diverged."""
    left, right = figure.subplots(1, 2)
    batch = result.batch
    for i, outcome in enumerate(batch.outcomes):
        force = batch.force_transmission[i]
        known = np.isfinite(force)
        if outcome.ok:
            left.plot(1e3 * TIMES, force, color="0.6", linewidth=0.8, label="sound" if i == 0 else None)
        else:
            name = outcome.name.lower().replace("_", " ")
            (line,) = left.plot(1e3 * TIMES[known], force[known], label=name)
            left.plot(1e3 * TIMES[known][-1], force[known][-1], "o", color=line.get_color())
    left.set_yscale("symlog", linthresh=10.0, linscale=1.0)
    ticks = [-10, 0, 10, 100, 1000]
    left.set_yticks(ticks, [str(tick) for tick in ticks])
    left.set(xlabel="time [ms]", ylabel="transmission force [N]", ylim=(-30.0, 5e4), xlim=(0.0, 1e3 * END))
    left.legend(ncols=2, loc="upper right")
    for (name, ratio), style in zip(result.motion.items(), ("-", "--", "-."), strict=True):
        right.semilogy(1e3 * TIMES[: len(ratio)], ratio, style, label=name)
    right.axhline(MOTION_LIMIT, color="0.3", linewidth=0.8, linestyle=":", label="limit")
    right.set(xlabel="time [ms]", ylabel="kinetic energy / work [-]", xlim=(0.0, 1e3 * END))
    right.set_ylim(bottom=0.008)
    right.legend(loc="lower left")


MEASURED = {
    Outcome.INVERTED: "smallest J",
    Outcome.STEP_COLLAPSED: "stable step over the first",
    Outcome.STEP_LIMIT: "stable step over the first",
    Outcome.TABLE_EXCEEDED: "largest s",
    Outcome.DIVERGED: "kinetic energy over work",
}
"""What NumPy computes of each failure."""


def page(result: Result) -> str:
    """The page's text."""
    batch = result.batch
    ends = [
        [
            str(i),
            WHY[i],
            outcome.name,
            f"{1e3 * batch.end_times[i]:.4f}",
            str(batch.steps[i]),
            "" if outcome.ok else str(batch.failed_elements[i]),
            "" if outcome.ok else ", ".join(f"{1e3 * x:.2f}" for x in batch.failed_places[i]),
        ]
        for i, outcome in enumerate(batch.outcomes)
    ]
    seen = [
        [
            str(i),
            str(w.named),
            str(w.found),
            MEASURED[batch.outcomes[i]],
            f"{w.before:.4g}",
            f"{w.value:.4g}",
            "yes" if w.same_history else "NO",
        ]
        for i, w in result.witnesses.items()
    ]
    good = result.bits
    return f"""# {TITLE}

**What is checked.** A simulation that cannot go on ends alone: it says why, when and in which element, keeps
every history up to its end and disturbs nobody.

**Independent source.** Node positions at the end and just before, from which NumPy computes J, s, the stable
step and the kinetic energy with the element constants of a rectangle in closed form; the same simulation
alone; the same simulation asked to end where it failed.

## A batch with every failure

Eight simulations (8 × 11 elements, bonded, ν = 0.495, to {1e3 * END:g} ms, `max_steps`
{STEPPING.max_steps}, `floor` {STEPPING.floor:g}, `past_data` "stop"):

{table(["row", "what is special", "outcome", "end [ms]", "steps", "element", "R, Y [mm]"], ends)}

Every row has the bits that it has alone, where the lanes share one simulation instead of being one each:
{"yes" if good["alone"] else "NO"}. The sound rows have the bits of a batch without the failures:
{"yes" if good["without"] else "NO"}.

`Response.describe` says it in a sentence, here of row {FAILED[0]}: "{batch.describe(FAILED[0])}."

## The element and the moment

The element that the solver names, and the one with the extreme value of NumPy's; that value when the
simulation was last found in order and at its end. Motion, turned elements and, by default, the stable step
are looked at every {CHECK_EVERY} steps, the end of the data (here s = {SHORT}) at every step where it ends a
run. The last column: every force, impulse, outline and energy before the end has the bits of a run that was
asked to end there, and is NaN after it:

{table(["row", "named", "found", "value", "before", "at the end", "same history"], seen)}

In row 4 nothing but the number of steps came to an end; the element named is the one that sets the step.

## Divergence

A specimen at rest cannot move with more energy than the platens gave it. Beyond {MOTION_LIMIT:g} times their
largest work so far a simulation has diverged, whatever the cause: in row 6 a curve whose energy falls with
strain; and row 0 again with a step that is measured once and never again, so that it is too long as soon as
the specimen is compressed. That run ends at {1e3 * result.unstable.end_times[0]:.3f} ms, when its recorded
forces differ by {result.astray:.2g} N from those of the sound run.

**Tolerance.** None where bits, elements and outcomes are compared; {ONSET:g} N for the forces of the unstable
run, what a force measurement resolves.
"""
