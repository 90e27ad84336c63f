"""The likelihood over the plane of two free parameters, with the paths of both profiles."""

import numpy as np
from matplotlib.figure import Figure

from kolsky.inverse.result import Identification
from kolsky.report.figures.base import (
    COLUMN,
    FORCE,
    MEASURED,
    MODEL,
    FigureKind,
    Panels,
    say_empty,
    smooth_bar,
)
from kolsky.report.nomenclature import axis_label, name_of

COLOURS = (MODEL, FORCE)
SHOWN = 5.0
"""Largest square root of the rise over the correlation that has a colour of its own."""


def caption(result: Identification) -> str:
    """What is seen."""
    assert result.ridge is not None
    first, second = (name_of(name).symbol for name in result.ridge.names)
    return (
        "Rise of −2 ln L over the plane of the two free parameters, over the factor by which correlated "
        f"residuals raise the variance of {first}; its square root is a distance in standard deviations. "
        f"Dashed: the profiles of {first} and {second}, on which the other parameter makes up for the change "
        "as well as it can; in the same colour the rise at which each has its 95 % interval. Star: the "
        "answer."
    )


def draw(result: Identification, panels: Panels) -> None:
    """Draw filled contours and both paths."""
    ax, ridge = panels["plane"], result.ridge
    assert ridge is not None
    profiles = {profile.name: profile for profile in result.profiles}
    if not set(ridge.names) <= set(profiles):
        say_empty(ax, "no profiles")
        return
    distance = np.sqrt(ridge.rise / profiles[ridge.names[0]].correlation)
    drawn = ax.contourf(
        ridge.x,
        ridge.y,
        np.minimum(distance, SHOWN),
        levels=np.linspace(0.0, SHOWN, 11),
        cmap="cividis_r",
    )
    for name, colour in zip(ridge.names, COLOURS, strict=True):
        profile = profiles[name]
        ax.contour(ridge.x, ridge.y, ridge.rise, levels=[profile.level], colors=colour, linewidths=0.9)
        ax.plot(*profile.points.T, color=colour, lw=0.8, ls="--", label=f"profile of ${name_of(name).tex}$")
    first, second = (result.estimates[name] for name in ridge.names)
    ax.plot(first.value, second.value, "*", ms=6, mfc="white", mec=MEASURED, mew=0.5, label="answer")
    ax.set_xlim(ridge.x[0], ridge.x[-1])
    ax.set_ylim(ridge.y[0], ridge.y[-1])
    ax.set_xlabel(axis_label(first.name, first.unit))
    ax.set_ylabel(axis_label(second.name, second.unit))
    ax.locator_params(axis="x", nbins=5)
    figure = ax.get_figure(root=True)
    assert isinstance(figure, Figure)
    smooth_bar(figure.colorbar(drawn, ax=ax, label="Distance from the best fit (σ)", pad=0.02))
    figure.legend(*ax.get_legend_handles_labels(), loc="outside upper center", ncols=3)


KIND = FigureKind(
    name="ridge",
    width=COLUMN,
    height=lambda result: 72.0,
    caption=caption,
    panels=lambda result: [["plane"]],
    draw=draw,
    applies=lambda result: result.ridge is not None,
)
