"""Transmitted force for several dampings, beside the measured one."""

from kolsky.report.figures.base import MEASURED, MS, PAGE, FigureKind, Panels, letter
from kolsky.studies.trends import Trends

COLOURS = ("#56B4E9", "#0072B2", "#E69F00", "#D55E00", "#CC79A7")


def caption(result: Trends) -> str:
    """What is seen."""
    return (
        f"Effect of the damping β on the simulated transmitted force at m = {result.stiffness:g}, beside the "
        "recorded one: the whole test (a), and the stretch in which it begins (b)."
    )


def draw(result: Trends, panels: Panels) -> None:
    """Draw all forces, and their beginning."""
    forces = result.damping
    time = MS * forces.time
    begin = time[0] + 0.4 * (time[-1] - time[0])
    for key, ax in zip("ab", panels.values(), strict=True):
        for beta, force, colour in zip(forces.damping, forces.simulated, COLOURS, strict=False):
            ax.plot(time, force, color=colour, lw=0.8, label=rf"$\beta$ = {1e6 * beta:g} µs")
        ax.plot(time, forces.measured, color=MEASURED, lw=0.6, ls="--", label="measured")
        ax.set(xlabel="Time (ms)", ylabel="Transmitted force (N)")
        letter(ax, key)
    panels["whole"].set_xlim(time[0], time[-1])
    panels["whole"].legend(loc="upper left")
    near = time <= begin
    low, high = forces.measured[near].min(), forces.measured[near].max()
    panels["begin"].set_xlim(time[0], begin)
    panels["begin"].set_ylim(low - 0.3 * (high - low), high + 0.5 * (high - low))


KIND: FigureKind[Trends] = FigureKind(
    name="trend-damping",
    width=PAGE,
    height=lambda result: 68.0,
    caption=caption,
    panels=lambda result: [["whole", "begin"]],
    draw=draw,
)
