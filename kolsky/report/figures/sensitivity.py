"""Figure of a global sensitivity: Sobol’ indices of misfits, and of force and outline through time."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MultipleLocator
from numpy.typing import NDArray

from kolsky.report.figures.base import MEASURED, MS, PAGE, FigureKind, Panels, label_panel
from kolsky.report.nomenclature import name_of
from kolsky.studies.global_sensitivity import GlobalSensitivity

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00")
WORDS = {"Phi_F": r"$\Phi_F$", "Phi_S": r"$\Phi_S$", "Phi": r"$\Phi$", "peak force": "peak force"}


def caption(result: GlobalSensitivity) -> str:
    """Return the caption."""
    ranges = ", ".join(
        f"{name_of(n).symbol} = {a * name_of(n).factor:.4g} to {b * name_of(n).factor:.4g}"
        + ("" if name_of(n).unit == "1" else f" {name_of(n).unit}")
        for n, a, b in zip(result.box.names, result.box.lower, result.box.upper, strict=True)
    )
    how = "on a surrogate of the response" if result.by_surrogate else "by the solver itself"
    return (
        f"Sobol’ indices over {ranges}, {how} ({result.runs} runs). (a) Total indices (bars, with 95 % "
        "intervals of the bootstrap) and first-order indices (dots) of misfits and peak force. (b) Indices "
        "of the mean force of every bin, (c) of the outline of every frame, its points weighted by their "
        "variance: total (solid) and first order (dashed)."
    )


def draw(result: GlobalSensitivity, panels: Panels) -> None:
    """Draw bars and two histories."""
    _bars(panels["scalars"], result)
    if result.force is not None:
        _history(panels["force"], result, result.force_times, result.force.first, result.force.total)
        panels["force"].set_ylabel("Index of the force (–)")
    if result.outline is not None:
        _history(panels["outline"], result, *result.outline_by_frame())
        panels["outline"].set_ylabel("Index of the outline (–)")
    for key, ax in zip("abc", panels.values(), strict=False):
        label_panel(ax, key)
    panels["scalars"].legend(loc="upper left", ncols=len(result.box.names))


def _bars(ax: Axes, result: GlobalSensitivity) -> None:
    s = result.scalars
    assert s is not None  # the figure does not apply without
    d = len(s.names)
    place = np.arange(len(s.outputs))
    for j, name in enumerate(s.names):
        x = place + (j - 0.5 * (d - 1)) * 0.8 / d
        low, high = s.total_interval[:, j].T
        ax.bar(x, s.total[:, j], 0.72 / d, color=COLOURS[j % 5], label=f"${name_of(name).tex}$")
        ax.vlines(x, low, high, color=MEASURED, lw=0.6)
        ax.plot(x, s.first[:, j], "o", color="white", mec=MEASURED, mew=0.5, ms=2.6)
    ax.set_xticks(place, [WORDS[name] for name in s.outputs])
    ax.tick_params(axis="x", length=0)
    ax.axhline(0.0, color=MEASURED, lw=0.5)
    ax.set_ylabel("Sobol’ index (–)")
    ax.yaxis.set_major_locator(MultipleLocator(0.2))
    ax.set_ylim(min(-0.05, 1.1 * float(s.first.min())), 1.25)


def _history(
    ax: Axes,
    result: GlobalSensitivity,
    times: NDArray[np.float64],
    first: NDArray[np.float64],
    total: NDArray[np.float64],
) -> None:
    for j, _ in enumerate(result.box.names):
        ax.plot(MS * times, total[j], color=COLOURS[j % 5], lw=0.8)
        ax.plot(MS * times, first[j], color=COLOURS[j % 5], lw=0.6, ls="--")
    ax.set_xlabel("Time (ms)")
    ax.yaxis.set_major_locator(MultipleLocator(0.2))
    ax.set_ylim(-0.1, 1.1)
    ax.set_xlim(MS * times[0], MS * times[-1])


def _panels(result: GlobalSensitivity) -> list[list[str]]:
    histories = [("force", result.force), ("outline", result.outline)]
    names = ["scalars", *(name for name, found in histories if found is not None)]
    return [names]


FIGURES: tuple[FigureKind[GlobalSensitivity], ...] = (
    FigureKind(
        name="sensitivity",
        width=PAGE,
        height=lambda result: 58.0,
        caption=caption,
        panels=_panels,
        draw=draw,
        applies=lambda result: result.scalars is not None,
    ),
)
