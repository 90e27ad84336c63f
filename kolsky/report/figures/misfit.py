"""Figures of the misfit along each parameter, its likelihood alone and over a pair, and the posterior."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from kolsky.inverse.result import Identification, SurrogateCurve
from kolsky.inverse.run_table import DesignTable
from kolsky.report.figures.base import (
    BAND,
    COLUMN,
    FORCE,
    GREY,
    MEASURED,
    MODEL,
    PAGE,
    ROUTES,
    SHAPE,
    Panels,
    colour_bar,
    few_ticks,
    figure,
    legend_above,
    note_empty,
    plain_log_ticks,
    weighted_chi2,
)
from kolsky.results.nomenclature import axis_label, name_of

MISFIT_PARTS = ("chi2", "phi")
RUN_MARKERS = {"design": "o", "refinement": "s", "check": "D"}


@figure(
    PAGE,
    lambda result: 58.0 * max(1, len(result.estimates)),
    lambda result: [[f"{name} {part}" for part in MISFIT_PARTS] for name in result.estimates],
    letters=True,
)
def misfit(result: Identification, panels: Panels) -> str:
    for name, estimate in result.estimates.items():
        curve = next((c for c in result.curves if c.parameter == name), None)
        chi2, phi = (panels[f"{name} {part}"] for part in MISFIT_PARTS)
        for ax in (chi2, phi):
            ax.set_xlabel(axis_label(name, estimate.unit))
            # Curves and runs are those of the refined mesh. Intervals are corrected for its error.
            if np.isfinite(estimate.on_mesh):
                ax.axvline(estimate.on_mesh, color=MEASURED, lw=0.6, ls="--")
            if np.isfinite(estimate.interval).all():
                ax.axvspan(*estimate.interval, color=BAND, alpha=0.35, lw=0.0)
        chi2.set_ylabel(r"$\chi^2/\chi^2_\mathrm{opt}$ (–)")
        phi.set_ylabel(r"$\Phi/\Phi_\mathrm{min}$ (–)")
        if curve is None:
            note_empty(chi2, "no surrogate")
            note_empty(phi, "no surrogate")
        else:
            _draw_chi2(chi2, curve, result)
            _draw_phi(phi, curve, result.design)
        for ax in (chi2, phi):
            few_ticks(ax, 5)
    others = "" if len(result.curves) < 2 else " (curves: the others at their optimum; pale: all runs)"
    return (
        f"Misfit along each free parameter{others}. Left: joint χ² of the surrogate, corrected to the "
        "refined mesh (line), and of the check runs on it (diamonds), over the surrogate’s smallest value; "
        "triangles: the optima of the force alone (orange) and of the outline alone (blue). Right: Φ_F and "
        "Φ_S, Eqs. (M.4) and (M.3), over the surrogate’s smallest values, with every run; those on the "
        "surrogate’s own mesh (circles: design, squares: refinement) lie off the lines by that mesh’s error. "
        "Crosses on the axis: runs that did not complete. Dashed line and band: the joint optimum and its "
        "k = 2 interval, numerical part included."
    )


def _draw_chi2(ax: Axes, curve: SurrogateCurve, result: Identification) -> None:
    design = result.design
    ax.set_yscale("log")
    ax.plot(curve.x, curve.chi2 / np.nanmin(curve.chi2), color=MEASURED)
    # The line is for the refined mesh. Runs on the surrogate's mesh do not belong to it.
    checks = np.where(np.array(design.stage) == "check", weighted_chi2(result), np.nan)
    _draw_runs(ax, design, curve.parameter, checks / np.nanmin(curve.chi2), MEASURED)
    # The searched surrogate covers a small box. The whole design is in the next panel.
    edge = 0.03 * (curve.x[-1] - curve.x[0])
    ax.set_xlim(curve.x[0] - edge, curve.x[-1] + edge)
    plain_log_ticks(ax.yaxis)
    ax.set_ylim(0.7, 1.5 * np.nanmax(curve.chi2) / np.nanmin(curve.chi2))
    # Triangles are on the lower frame: at this scale the optima are closer than their names are wide.
    for route in result.routes:
        if route.name in ("force only", "shape only"):
            x = route.on_mesh(curve.parameter) if curve.parameter in route.parameters else np.nan
            place: dict[str, Any] = {"transform": ax.get_xaxis_transform()}
            ax.plot(x, 0.03, "^", color=ROUTES[route.name], ms=3.2, mew=0.0, **place)


def _draw_phi(ax: Axes, curve: SurrogateCurve, design: DesignTable) -> None:
    ax.set_yscale("log")
    terms = (
        (r"$\Phi_F$", curve.phi_force, design.phi_force, FORCE, -18.0),
        (r"$\Phi_S$", curve.phi_shape, design.phi_shape, SHAPE, 0.0),
    )
    for label, along, runs, colour, aside in terms:
        if not np.isfinite(along).any():  # no outline was measured
            continue
        smallest = np.nanmin(along)
        ax.plot(curve.x, along / smallest, color=colour)
        # Triangles are above the frame, because runs are everywhere inside it.
        above: dict[str, Any] = {"xycoords": "axes fraction", "textcoords": "offset points", "ha": "right"}
        ax.annotate(label, (1.0, 1.0), xytext=(aside, 2.5), color=colour, annotation_clip=False, **above)
        _draw_runs(ax, design, curve.parameter, runs / smallest, colour)
    ax.margins(x=0.08, y=0.1)
    # Failed runs are on the frame of the panel: they have a position but no misfit.
    frame: dict[str, Any] = {"transform": ax.get_xaxis_transform(), "clip_on": False}
    for place in design.points[~np.isfinite(design.phi_force), design.names.index(curve.parameter)]:
        ax.plot(place, 0.0, "x", color=MEASURED, ms=3.0, mew=0.7, **frame)
    plain_log_ticks(ax.yaxis)


def _draw_runs(
    ax: Axes, design: DesignTable, parameter: str, values: NDArray[np.float64], colour: str
) -> None:
    x = design.points[:, design.names.index(parameter)]
    # A run off the line through the optimum depends on the other parameters too. It is drawn paler.
    style: dict[str, Any] = {"ms": 2.6, "mfc": "white", "mec": colour, "mew": 0.6, "ls": "none"}
    style["alpha"] = 1.0 if len(design.names) == 1 else 0.45
    for stage in dict.fromkeys(design.stage):
        rows = np.array([s == stage for s in design.stage]) & np.isfinite(values)
        ax.plot(x[rows], values[rows], RUN_MARKERS.get(stage, "v"), **style)


LIKELIHOOD_THRESHOLD = 3.84


@figure(
    COLUMN,
    lambda result: 46.0 * len(result.profiles),
    lambda result: [[profile.name] for profile in result.profiles],
    applies=lambda result: bool(result.profiles),
    letters=True,
)
def likelihood(result: Identification, panels: Panels) -> str:
    for profile in result.profiles:
        ax = panels[profile.name]
        low, high = profile.interval
        left, right = profile.values[0], profile.values[-1]
        low, high = (left if np.isnan(low) else low), (right if np.isnan(high) else high)
        ax.axvspan(low, high, color=BAND, alpha=0.35, lw=0.0)
        ax.axhline(LIKELIHOOD_THRESHOLD, color=GREY, lw=0.7, ls="--")
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
        ax.set_ylim(min(0.0, rise.min()), 2.5 * LIKELIHOOD_THRESHOLD)
        ax.set_xlabel(axis_label(profile.name, result.estimates[profile.name].unit))
        ax.set_ylabel(r"Rise of $-2\,\ln L$ (–)")
        few_ticks(ax, 5)
    others = ", the other parameters re-optimised at every point" if len(result.profiles) > 1 else ""
    return (
        f"Profile likelihood of each free parameter from the noise of force and outline{others}: the rise of "
        "−2 ln L over its smallest value and over the factor by which residuals that are correlated in time "
        "raise the parameter’s variance. Dashed: 3.84, where the 95 % interval (band) ends; dotted: the "
        "answer."
    )


LIKELIHOOD_COLOURS = (MODEL, FORCE)
MOST_SAMPLES = 5.0
"""Largest square root of the rise with a separate colour. The rise is divided by the correlation."""


@figure(COLUMN, 72.0, [["plane"]], applies=lambda result: result.ridge is not None)
def ridge(result: Identification, panels: Panels) -> str:
    ax, ridge = panels["plane"], result.ridge
    assert ridge is not None  # checked by `applies`
    symbols = [name_of(name).symbol for name in ridge.names]
    caption = (
        "Rise of −2 ln L over the plane of the two free parameters, over the factor by which correlated "
        f"residuals raise the variance of {symbols[0]}; its square root is a distance in standard "
        f"deviations. Dashed: the profiles of {' and '.join(symbols)}, on which the other parameter is "
        "optimised at every point; in the same colour the rise at which each has its 95 % interval. Star: "
        "the answer."
    )
    profiles = {profile.name: profile for profile in result.profiles}
    if not set(ridge.names) <= set(profiles):
        note_empty(ax, "no profiles")
        return caption
    distance = np.sqrt(ridge.rise / profiles[ridge.names[0]].correlation)
    levels = np.linspace(0.0, MOST_SAMPLES, 11)
    drawn = ax.contourf(ridge.x, ridge.y, np.minimum(distance, MOST_SAMPLES), levels, cmap="cividis_r")
    for name, colour in zip(ridge.names, LIKELIHOOD_COLOURS, strict=True):
        profile = profiles[name]
        ax.contour(ridge.x, ridge.y, ridge.rise, levels=[profile.level], colors=colour, linewidths=0.9)
        ax.plot(*profile.points.T, color=colour, lw=0.8, ls="--", label=f"profile of ${name_of(name).tex}$")
    first, second = (result.estimates[name] for name in ridge.names)
    ax.plot(first.on_mesh, second.on_mesh, "*", ms=6, mfc="white", mec=MEASURED, mew=0.5, label="answer")
    ax.set_xlim(ridge.x[0], ridge.x[-1])
    ax.set_ylim(ridge.y[0], ridge.y[-1])
    ax.set(xlabel=axis_label(first.name, first.unit), ylabel=axis_label(second.name, second.unit))
    few_ticks(ax, 5)
    colour_bar(drawn, ax, "Distance from the best fit (σ)", pad=0.02)
    legend_above(ax, ncols=3)
    return caption


BINS = 30
DOTS = 800
"""Maximum number of samples drawn as dots of a pair."""


def _corner_panels(result: Identification) -> list[list[str]]:
    """The lower triangle."""
    assert result.posterior is not None
    names = result.posterior.names
    return [
        [f"{row} {column}" if j <= i else "." for j, column in enumerate(names)]
        for i, row in enumerate(names)
    ]


@figure(
    PAGE,
    lambda result: 20.0 + 36.0 * len(result.posterior.names if result.posterior else ()),
    _corner_panels,
    applies=lambda result: result.posterior is not None,
)
def corner(result: Identification, panels: Panels) -> str:
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
                ax.set_xlabel(_corner_label(column))
            else:
                ax.tick_params(labelbottom=False)
            if j == 0 and i:
                ax.set_ylabel(_corner_label(row))
            elif i != j:
                ax.tick_params(labelleft=False)
            ax.set_xlim(np.min(x), np.max(x))
            few_ticks(ax, 4)
            if i != j:
                ax.set_ylim(np.min(y), np.max(y))
    state = "converged" if chains.converged else "not converged"
    return (
        f"Samples of the posterior ({state}, {chains.steps} steps of each walker, longest autocorrelation "
        f"time {chains.autocorrelation:.3g} steps) with the likelihood to the power of {chains.power:.3g}. "
        f"Dashed: median; dotted: 95 % interval; lines across pairs: the answer. Priors: {chains.prior}."
    )


def _corner_label(name: str) -> str:
    shown = name_of(name)
    return f"${shown.tex}$ ({'–' if shown.unit == '1' else shown.unit})"
