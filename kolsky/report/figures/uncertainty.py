"""Figures of the uncertainty: profile likelihood, joint likelihood of a pair, posterior samples."""

import numpy as np
from matplotlib.figure import Figure

from kolsky.inverse.result import Identification
from kolsky.report.figures.base import (
    BAND,
    COLUMN,
    FORCE,
    GREY,
    MEASURED,
    MODEL,
    PAGE,
    FigureKind,
    Panels,
    few_ticks,
    label_panel,
    note_empty,
    smooth_bar,
)
from kolsky.report.nomenclature import axis_label, name_of

THRESHOLD = 3.84


def caption_likelihood(result: Identification) -> str:
    """Return the caption."""
    others = ", the other parameters re-optimised at every point" if len(result.profiles) > 1 else ""
    return (
        f"Profile likelihood of each free parameter from the noise of force and outline{others}: the rise of "
        "−2 ln L over its smallest value and over the factor by which residuals that are correlated in time "
        "raise the parameter’s variance. Dashed: 3.84, where the 95 % interval (band) ends; dotted: the "
        "answer."
    )


def draw_likelihood(result: Identification, panels: Panels) -> None:
    """Draw one panel per parameter."""
    for number, profile in enumerate(result.profiles):
        ax = panels[profile.name]
        if len(result.profiles) > 1:
            label_panel(ax, "abcdefghijkl"[number])
        low, high = profile.interval
        left, right = profile.values[0], profile.values[-1]
        low, high = (left if np.isnan(low) else low), (right if np.isnan(high) else high)
        ax.axvspan(low, high, color=BAND, alpha=0.35, lw=0.0)
        ax.axhline(THRESHOLD, color=GREY, lw=0.7, ls="--")
        ax.axvline(result.estimates[profile.name].on_mesh, color=MEASURED, lw=0.6, ls=":")
        rise = profile.rise / profile.correlation
        side = np.where(np.arange(rise.size) < np.argmin(rise), -1.0, 1.0)
        if rise.min() < 0.0:  # a rough one, on which a lower point than the optimum was found
            ax.plot(profile.values, rise, color=MODEL)
        else:  # nearly a parabola between its points: its signed root is nearly straight
            fine = np.linspace(left, right, 2001)
            ax.plot(fine, np.interp(fine, profile.values, side * np.sqrt(rise)) ** 2, color=MODEL)
        ax.plot(profile.values, rise, "o", color=MODEL, ms=1.8, mew=0.0)
        margin = 0.6 * (high - low)
        ax.set_xlim(max(left, low - margin), min(right, high + margin))
        ax.set_ylim(min(0.0, rise.min()), 2.5 * THRESHOLD)
        ax.set_xlabel(axis_label(profile.name, result.estimates[profile.name].unit))
        ax.set_ylabel(r"Rise of $-2\,\ln L$ (–)")
        few_ticks(ax, 5)


COLOURS = (MODEL, FORCE)
SHOWN = 5.0
"""Largest square root of the rise over the correlation that has a colour of its own."""


def caption_ridge(result: Identification) -> str:
    """Return the caption."""
    assert result.ridge is not None
    first, second = (name_of(name).symbol for name in result.ridge.names)
    return (
        "Rise of −2 ln L over the plane of the two free parameters, over the factor by which correlated "
        f"residuals raise the variance of {first}; its square root is a distance in standard deviations. "
        f"Dashed: the profiles of {first} and {second}, on which the other parameter is optimised at "
        "every point; in the same colour the rise at which each has its 95 % interval. Star: the "
        "answer."
    )


def draw_ridge(result: Identification, panels: Panels) -> None:
    """Draw filled contours and both paths."""
    ax, ridge = panels["plane"], result.ridge
    assert ridge is not None
    profiles = {profile.name: profile for profile in result.profiles}
    if not set(ridge.names) <= set(profiles):
        note_empty(ax, "no profiles")
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
    ax.plot(first.on_mesh, second.on_mesh, "*", ms=6, mfc="white", mec=MEASURED, mew=0.5, label="answer")
    ax.set_xlim(ridge.x[0], ridge.x[-1])
    ax.set_ylim(ridge.y[0], ridge.y[-1])
    ax.set_xlabel(axis_label(first.name, first.unit))
    ax.set_ylabel(axis_label(second.name, second.unit))
    few_ticks(ax, 5)
    figure = ax.get_figure(root=True)
    assert isinstance(figure, Figure)
    smooth_bar(figure.colorbar(drawn, ax=ax, label="Distance from the best fit (σ)", pad=0.02))
    figure.legend(*ax.get_legend_handles_labels(), loc="outside upper center", ncols=3)


BINS = 30
DOTS = 800
"""Most samples drawn as dots of a pair."""


def caption_corner(result: Identification) -> str:
    """Return the caption."""
    assert result.posterior is not None
    chains = result.posterior
    state = "converged" if chains.converged else "not converged"
    return (
        f"Samples of the posterior ({state}, {chains.steps} steps of each walker, longest autocorrelation "
        f"time {chains.autocorrelation:.3g} steps) with the likelihood to the power of {chains.power:.3g}. "
        "Dashed: median; dotted: 95 % interval; lines across pairs: the answer. Priors: "
        f"{chains.prior}."
    )


def draw_corner(result: Identification, panels: Panels) -> None:
    """Draw histograms on the diagonal, pairs below it."""
    chains = result.posterior
    assert chains is not None
    every = max(1, -(-len(chains.samples) // DOTS))
    for i, row in enumerate(chains.names):
        for j, column in enumerate(chains.names[: i + 1]):
            ax = panels[f"{row} {column}"]
            x, y = chains.samples[:, j], chains.samples[:, i]
            if i == j:
                ax.hist(x, bins=BINS, color=MODEL, alpha=0.6, lw=0.0)
                ax.axvline(chains.median[i], color=MEASURED, lw=0.7, ls="--")
                for end in (chains.lower[i], chains.upper[i]):
                    ax.axvline(end, color=GREY, lw=0.7, ls=":")
                ax.set_yticks([])
            else:
                ax.plot(x[::every], y[::every], ".", color=MODEL, ms=2.0, mew=0.0, alpha=0.6)
                for name, line in ((column, ax.axvline), (row, ax.axhline)):
                    if name in result.estimates:
                        line(result.estimates[name].on_mesh, color=MEASURED, lw=0.5)
            if i == len(chains.names) - 1:
                ax.set_xlabel(_label(column))
            else:
                ax.tick_params(labelbottom=False)
            if j == 0 and i:
                ax.set_ylabel(_label(row))
            elif i != j:
                ax.tick_params(labelleft=False)
            ax.set_xlim(np.min(x), np.max(x))
            few_ticks(ax, 4)
            if i != j:
                ax.set_ylim(np.min(y), np.max(y))


def _label(name: str) -> str:
    shown = name_of(name)
    return f"${shown.tex}$ ({'–' if shown.unit == '1' else shown.unit})"


def panels(result: Identification) -> list[list[str]]:
    """The lower triangle."""
    assert result.posterior is not None
    names = result.posterior.names
    return [
        [f"{row} {column}" if j <= i else "." for j, column in enumerate(names)]
        for i, row in enumerate(names)
    ]


FIGURES: tuple[FigureKind[Identification], ...] = (
    FigureKind(
        name="likelihood",
        width=COLUMN,
        height=lambda result: 46.0 * len(result.profiles),
        caption=caption_likelihood,
        panels=lambda result: [[profile.name] for profile in result.profiles],
        draw=draw_likelihood,
        applies=lambda result: bool(result.profiles),
    ),
    FigureKind(
        name="ridge",
        width=COLUMN,
        height=lambda result: 72.0,
        caption=caption_ridge,
        panels=lambda result: [["plane"]],
        draw=draw_ridge,
        applies=lambda result: result.ridge is not None,
    ),
    FigureKind(
        name="corner",
        width=PAGE,
        height=lambda result: 20.0 + 36.0 * len(result.posterior.names if result.posterior else ()),
        caption=caption_corner,
        panels=panels,
        draw=draw_corner,
        applies=lambda result: result.posterior is not None,
    ),
)
