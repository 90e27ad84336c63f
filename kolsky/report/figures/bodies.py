"""Figures of whole specimens, sheets and actuators: forces, fields, shapes, correlations, closed loop."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.tri import Triangulation

from kolsky.base.arrays import BoolArray, FloatArray
from kolsky.bodies.actuator_model import Bending
from kolsky.report.body_views import BINS, ActuatorView, SheetView, SpecimenView, outer_faces, side_view
from kolsky.report.figures.base import (
    BAND,
    BAR,
    FORCE,
    GREY,
    LETTERS,
    MEASURED,
    MM,
    MODEL,
    MS,
    PAGE,
    SHAPE,
    Panels,
    colour_bar,
    figure,
    label_panel,
    label_point,
    label_text,
    note_empty,
)
from kolsky.results.nomenclature import constant_symbol

COLOURS = (MODEL, SHAPE, FORCE, BAND, GREY)
"""Colours of the fits, in turn."""
MOST_TESTS = 6
"""Maximum number of tests with a separate panel. The CSV file has all tests."""
LEAST_SHARE = 1e-4
"""Smallest share of the volume on the axis."""


def _panels(view: SpecimenView) -> list[list[str]]:
    names = list(view.tests)[:MOST_TESTS]
    return [names, [f"{name} residual" for name in names]]


@figure(PAGE, 105.0, _panels, height_ratios=[2.0, 1.0])
def forces(view: SpecimenView, panels: Panels) -> str:
    for letter, name in zip(LETTERS, view.tests[:MOST_TESTS], strict=False):
        above, below = panels[name], panels[f"{name} residual"]
        label_panel(above, letter)
        fits = [
            (colour, fit.name, one)
            for colour, fit in zip(COLOURS, view.fits, strict=False)
            for one in fit.tests
            if one.test.name == name
        ]
        for number, (colour, fit_name, one) in enumerate(fits):
            samples = one.test.samples
            for end, (marker, dash, of) in enumerate((("o", "-", ""), ("s", "--", ", y"))):
                if end >= samples.force.shape[1]:
                    continue
                x, measured, f = MM * samples.displacement[:, end], samples.force[:, end], one.force[:, end]
                if number == 0:
                    rings: dict[str, Any] = {"color": MEASURED, "ms": 3, "mfc": "none"}
                    above.plot(x, measured, marker, label=f"measured{of}", **rings)
                words = label_text(fit_name + ("" if one.fitted else ", predicted"), 28)
                above.plot(x, f, dash, color=colour, lw=1.0, label=None if end else words)
                low, high = f - one.band[:, end], f + one.band[:, end]
                above.fill_between(x, low, high, color=colour, alpha=0.25, lw=0)
                below.plot(x, f - measured, marker + "-", color=colour, ms=2, lw=0.7)
        above.set_title(label_text(name, 24), fontsize="medium")
        above.set_ylabel("force (N)")
        above.legend(frameon=False, fontsize="small")
        sigma = fits[0][2].test.samples.sigma_force
        below.axhspan(-2.0 * sigma, 2.0 * sigma, color=GREY, alpha=0.2, lw=0)
        below.set(xlabel="displacement (mm)", ylabel="fit less data (N)")
    return (
        "Force over displacement, measured and simulated with the constants of each fit (bands: 95 % "
        "from the constants alone), and its residual, with ± 2 standard deviations of the declared noise "
        "(grey)."
    )


@figure(
    PAGE,
    55.0,
    lambda view: [[found.name for found in view.fits[:3]]],
    applies=lambda view: len(view.fits[0].constants.free) > 1,
    letters=True,
)
def correlations(view: SpecimenView, panels: Panels) -> str:
    for number, fit in enumerate(view.fits[:3]):
        ax = panels[fit.name]
        values = np.nan_to_num(fit.intervals.correlation)
        image = ax.pcolormesh(values, vmin=-1.0, vmax=1.0, cmap="RdBu_r")
        names = [constant_symbol(name) for name in fit.constants.free]
        ticks = np.arange(len(names)) + 0.5
        ax.set_xticks(ticks, names)
        ax.set_yticks(ticks, names)
        ax.invert_yaxis()
        ax.set_title(label_text(fit.name, 24), fontsize="medium")
        for (i, j), value in np.ndenumerate(values):
            dark = abs(value) > 0.6
            ax.text(
                j + 0.5, i + 0.5, f"{value:.3f}", ha="center", va="center", fontsize="small",
                color="white" if dark else "black",
            )  # fmt: skip
        if number == min(len(view.fits), 3) - 1:
            colour_bar(image, ax, "correlation")
    return (
        "Correlations of the fitted constants. Near ± 1 a test determines a combination of two constants and "
        "not each: another kind of test distinguishes them."
    )


@figure(
    PAGE,
    lambda view: 55.0 * len(view.shares[:MOST_TESTS]),
    lambda view: [[f"{s.name} whole", f"{s.name} middle"] for s in view.shares[:MOST_TESTS]],
    applies=lambda view: bool(view.shares),
    letters=True,
)
def strains(view: SpecimenView, panels: Panels) -> str:
    for share in view.shares[:MOST_TESTS]:
        for name, values in (("whole", share.whole), ("middle", share.middle)):
            ax = panels[f"{share.name} {name}"]
            for axis, colour in zip(range(3), (MODEL, SHAPE, MEASURED), strict=True):
                style = "--" if axis == 1 else "-"
                ax.stairs(
                    np.maximum(values[axis], LEAST_SHARE), BINS, baseline=LEAST_SHARE, color=colour, ls=style,
                    label="xyz"[axis],
                )  # fmt: skip
            ax.set_yscale("log")
            ax.set_ylim(LEAST_SHARE, 1.5)
            bins = np.flatnonzero(share.whole.max(axis=0))
            ax.set_xlim(BINS[max(bins[0] - 1, 0)], BINS[min(bins[-1] + 2, len(BINS) - 1)])
            ax.set(xlabel="strain (–)", ylabel="share of the volume")
            words = "whole specimen" if name == "whole" else "mid-region"
            ax.set_title(f"{label_text(share.name, 16)}, {words}", fontsize="medium")
            ax.legend(frameon=False, fontsize="small", title="along")
    return (
        "Strains along the axes at the last sample, by volume: left the whole specimen with its ends, "
        "right only the uniform middle, which a fit of the mid-region uses."
    )


@figure(PAGE, 70.0, lambda view: [list(view.solutions)[:3]], applies=lambda view: bool(view.solutions))
def mesh(view: SpecimenView, panels: Panels) -> str:
    for name, solution in view.solutions.items():
        if name not in panels:
            continue
        ax, mesh = panels[name], solution.model.mesh
        u = solution.displacements[solution.reached - 1]
        top = mesh.points[:, 2].max()
        corners = mesh.cells[:, 4:8]  # VTK: the face of larger z
        upper = corners[np.abs(mesh.points[corners, 2] - top).max(axis=1) < 1e-9]
        reference, deformed = mesh.points[upper][..., :2], (mesh.points + u)[upper][..., :2]
        edges = [np.stack([c[:, 1] - c[:, 0], c[:, 3] - c[:, 0]], axis=-1) for c in (reference, deformed)]
        stretch = np.linalg.norm(edges[1] @ np.linalg.inv(edges[0]), ord=2, axis=(1, 2))
        faces = PolyCollection(
            list(MM * deformed), array=stretch, cmap="viridis", edgecolor="white", linewidth=0.1
        )
        ax.add_collection(faces)
        ax.autoscale_view()
        ax.set(aspect="equal", xlabel="$x$ (mm)", ylabel="$y$ (mm)")
        ax.set_title(label_text(name, 24), fontsize="medium")
        colour_bar(faces, ax, "largest stretch in the face", fraction=0.04)
    return (
        "Largest stretch of the element faces on the bonded surface at the last sample, in the deformed "
        "state; where symmetry allows an eighth of the specimen is simulated."
    )


MN = 1e3
"""Newtons to millinewtons."""


@figure(PAGE, 62.0, [["force", "misfit"]], letters=True)
def sheet_histories(view: SheetView, panels: Panels) -> str:
    fit = view.fit
    data, pad = fit.problem.data, MM * np.abs(fit.problem.data.pad)
    ax = panels["force"]
    ax.plot(pad, MN * np.abs(data.force), "o", color=MEASURED, mfc="none", ms=3, label="measured")
    ax.plot(pad, MN * np.abs(fit.cost.state.force), "-", color=MODEL, label="simulated")
    ax.set_ylabel("pad force (mN)")
    ax.legend(frameon=False)
    ax = panels["misfit"]
    ax.plot(pad, 100.0 * fit.misfit, "o-", color=SHAPE, ms=3, label="misfit")
    ax.plot(pad, 100.0 * fit.noise, "--", color=GREY, label="noise alone")
    ax.set_ylabel("displacement misfit (%)")
    ax.set_ylim(bottom=0.0)
    ax.legend(frameon=False)
    for one in (panels["force"], panels["misfit"]):
        one.set_xlabel("pad displacement (mm)")
    return (
        "(a) Force on the pad. (b) Root mean square of simulated minus measured displacements over the "
        "measured ones in the measured region, and the value expected from the noise of the points."
    )


@figure(
    PAGE,
    110.0,
    lambda view: [list(view.fit.constants.free), [f"{name} noise" for name in view.fit.constants.free]],
    letters=True,
)
def sheet_steps(view: SheetView, panels: Panels) -> str:
    fit, free = view.fit, view.fit.constants.free
    pad = MM * np.abs(fit.problem.data.pad)
    by_u, by_f = 1e-6 * fit.relative_by_displacement, 1e-3 * fit.relative_by_force
    for j, name in enumerate(free):
        ax = panels[name]
        scale = 1e-3 if fit.constants.free_specs[j].unit == "Pa" else 1.0
        unit = " (kPa)" if scale != 1.0 else ""
        single = [np.nan if isinstance(step, str) else scale * step.values[j] for step in view.steps]
        if single:
            ax.plot(pad, single, "o", color=MEASURED, mfc="none", ms=3, label="step alone")
        ax.axhline(scale * fit.values[j], color=MODEL, label="all steps")
        ax.set_ylabel(f"{constant_symbol(name)}{unit}")
        ax.legend(frameon=False)
        below = panels[f"{name} noise"]
        if fit.at_bound[j]:
            note_empty(below, "at its bound")
        else:
            for by, mark, colour, label in ((by_u, "o-", SHAPE, "1 µm"), (by_f, "s-", FORCE, "1 mN")):
                below.semilogy(pad, 100.0 * np.maximum(by[:, j], 1e-9), mark, color=colour, ms=3, label=label)
            below.set_ylabel(f"relative deviation of {constant_symbol(name)} (%)")
            below.legend(frameon=False, title="noise of")
        for one in (ax, below):
            one.set_xlim(0.0, 1.05 * pad.max())
            one.set_xlabel("pad displacement (mm)")
    return (
        "Upper row: constants fitted to each step alone and to all together; a drift shows that the law is "
        "not the material's. Lower row: standard deviation of each constant over its value from noise of the "
        "displacement of every node (1 µm) and of the force (1 mN) in one step, Eqs. (20) to (25) of Sutula "
        "et al. (2020)."
    )


def _field(
    ax: Axes,
    view: SheetView,
    value: FloatArray,
    vectors: FloatArray | None,
    label: str,
    near: BoolArray | None = None,
) -> None:
    points = MM * view.mesh.points
    x, y = MM * points.T[:2]
    image = ax.tripcolor(
        Triangulation(x, y, view.mesh.cells[:, :3]), value, cmap="viridis", rasterized=True, shading="gouraud"
    )
    ax.set(aspect="equal", xlabel="$x$ (mm)", ylabel="$y$ (mm)")
    colour_bar(image, ax, label, fraction=0.03)
    if vectors is not None:
        size = np.linalg.norm(vectors, axis=1)
        long = np.flatnonzero(size > 0.02 * size.max())
        chosen = long[:: max(1, len(long) // 150)]
        ax.quiver(*points[chosen, :2].T, *vectors[chosen, :2].T, color="white", width=0.003)
    if near is not None:
        (x0, y0), (x1, y1) = points[near].min(axis=0), points[near].max(axis=0)
        gap = 0.05 * max(x1 - x0, y1 - y0)
        ax.set_xlim(x0 - gap, x1 + gap)
        ax.set_ylim(y0 - gap, y1 + gap)


@figure(PAGE, 95.0, [["u", "misfit"], ["sensitivity", "before"]], letters=True)
def sheet_fields(view: SheetView, panels: Panels) -> str:
    found = view.fit
    state, data = found.cost.state, found.problem.data
    inside = np.zeros(len(view.mesh.points), dtype=bool)
    inside[view.mesh.cells[data.cells].ravel()] = True
    u = state.displacements[-1]
    _field(panels["u"], view, MM * np.linalg.norm(u, axis=1), None, "displacement (mm)")
    apart = np.where(inside[:, None], u - data.displacements[-1], 0.0)
    _field(panels["misfit"], view, MM * np.linalg.norm(apart, axis=1), apart, "misfit (mm)", inside)
    weakest = int(np.argmax(np.linalg.norm(view.sensitivity, axis=(1, 2))))
    field = view.sensitivity[weakest] * 1e-9
    name = constant_symbol(found.constants.free[weakest])
    _field(panels["sensitivity"], view, np.linalg.norm(field, axis=1), field, f"{name} (1/mm$^3$)", inside)
    n = len(view.mesh.points)
    best = view.before.field[-1].reshape(2, n).T * 1e-9
    _field(panels["before"], view, np.linalg.norm(best, axis=1), best, "whole sheet (1/mm$^3$)")
    names = [name for name, bound in zip(found.constants.free, found.at_bound, strict=True) if not bound]
    if view.before.singular:
        parts = [
            f"{weight:+.2f} {name}" for weight, name in zip(view.before.directions[-1], names, strict=True)
        ]
        of = f"the one combination of relative constants that displacements see ({', '.join(parts)})"
    else:
        of = names[-1]
    return (
        "Last step. (a) Simulated displacement. (b) Simulated minus measured displacement in the "
        "measured region. (c) Relative change of the constant that displacements move most, as a field "
        "over the measured displacements, Eqs. (26) and (27) of Sutula et al. (2020). (d) The same for a "
        f"measurement of the whole sheet, before it is made, for {of}, Eqs. (28) to (36)."
    )


STATE_COLOURS = (SHAPE, MODEL, FORCE, GREY)
"""Colours of the directions of gravity, in turn."""
MOST_DIRECTIONS = 3
"""Maximum number of directions with separate panels. The tables have all directions."""
SHADES = 0.45, 0.9
"""Grey of faces across and along the line of sight."""


def draw_shape(ax: Axes, run: Bending, step: int) -> None:
    """Draw an actuator from the side at one step."""
    mesh = run.solution.model.mesh
    corners, facing = side_view(mesh.points + run.solution.displacements[step], outer_faces(mesh))
    low, high = SHADES
    grey = low + (high - low) * facing
    ax.add_collection(
        PolyCollection(
            list(MM * corners), facecolors=[(0.8 * g, 0.9 * g, g) for g in grey], edgecolors="0.3",
            linewidths=0.1,
        )
    )  # fmt: skip
    ax.set_aspect("equal")
    ax.autoscale_view()


@figure(
    PAGE,
    lambda view: 60.0 * min(len(view.directions), MOST_DIRECTIONS),
    lambda view: [
        [f"{one.name} {k}" for k in range(len(one.asked[-3:]))] for one in view.directions[:MOST_DIRECTIONS]
    ],
    applies=lambda view: bool(view.directions),
)
def shapes(view: ActuatorView, panels: Panels) -> str:
    for number, one in enumerate(view.directions[:MOST_DIRECTIONS]):
        for k, step in enumerate(one.asked[-3:]):
            ax = panels[f"{one.name} {k}"]
            draw_shape(ax, one.pristine, int(step))
            bar = BAR * float(one.pristine.pressures[step].max())
            ax.set_title(f"{label_text(one.name, 16)}, {bar:.3g} bar", fontsize="small")
            ax.set_xlabel("$x$ (mm)")
            if k == 0:
                ax.set_ylabel("$z$ (mm)")
                label_panel(ax, "abc"[number])
    return "The actuator at the largest declared pressures, seen from the side, in the deformed state."


@figure(PAGE, 75.0, [["bend"]], applies=lambda view: bool(view.directions))
def bend(view: ActuatorView, panels: Panels) -> str:
    ax = panels["bend"]
    for colour, one in zip(STATE_COLOURS, view.directions, strict=False):
        run, name = one.pristine, label_text(one.name, 20)
        bar = BAR * run.pressures.max(axis=1)
        ax.plot(bar, np.degrees(run.angle), "-", color=colour, lw=1.0, ms=3, label=name)
        ax.plot(bar[one.asked], np.degrees(run.angle[one.asked]), "o", color=colour, ms=4)
        if one.healed is not None:
            ax.plot(bar, np.degrees(one.healed.angle), "--", color=colour, lw=1.0, label=f"{name}, healed")
    ax.set(xlabel="pressure (bar)", ylabel="bending angle (°)")
    ax.legend(frameon=False, fontsize="small")
    healed = any(one.healed is not None for one in view.directions)
    text = "Bending angle over pressure in every direction of gravity; dots are the declared pressures."
    return text + (" Dashed: with the constants of the healed material." if healed else "")


@figure(
    PAGE,
    80.0,
    lambda view: [list(dict.fromkeys(one.gravity for one in view.markers))[:MOST_DIRECTIONS]],
    applies=lambda view: bool(view.markers),
    letters=True,
)
def markers(view: ActuatorView, panels: Panels) -> str:
    names = list(dict.fromkeys(one.gravity for one in view.markers))[:MOST_DIRECTIONS]
    for name in names:
        ax = panels[name]
        for one in view.markers:
            if one.gravity == name:
                ax.plot(*(MM * one.simulated.T), "--", color=SHAPE, lw=0.8)
                ax.plot(*(MM * one.measured.T), "x", color=MEASURED, ms=3)
                end = MM * one.simulated[-1]
                label_point(ax, f"{BAR * one.pressure:.3g} bar", end, (4, 0), fontsize="small")
        ax.set_aspect("equal")
        ax.set_title(label_text(name, 24), fontsize="medium")
        ax.set(xlabel="$x$ (mm)", ylabel="$z$ (mm)")
    return "Markers: measured centroids (crosses) and the simulated positions of the same points (dashed)."


@figure(
    PAGE, 130.0, [["angle"], ["pressure"], ["wall"]], applies=lambda view: bool(view.closed), letters=True
)
def loop(view: ActuatorView, panels: Panels) -> str:
    above, middle, below = panels["angle"], panels["pressure"], panels["wall"]
    for colour, (name, run) in zip(STATE_COLOURS, view.closed.items(), strict=False):
        above.plot(run.time, np.degrees(run.measured), ".", color=colour, ms=1, alpha=0.4)
        above.plot(run.time, np.degrees(run.angle), "-", color=colour, lw=1.0, label=label_text(name, 20))
        middle.plot(run.time, BAR * run.pressure, "-", color=colour, lw=0.8)
        below.plot(run.time, MS * run.wall, ".", color=colour, ms=1)
    run = next(iter(view.closed.values()))
    above.plot(run.time, np.degrees(run.wanted), "--", color=MEASURED, lw=0.8, label="wanted")
    below.axhline(MS / run.rate, color=MEASURED, lw=0.8, ls="--")
    above.set_ylabel("angle (°)")
    above.legend(frameon=False, fontsize="small", ncols=4)
    middle.set_ylabel("pressure (bar)")
    below.set_ylabel("wall time (ms)")
    below.set_yscale("log")
    below.set_xlabel("time (s)")
    return (
        "The closed loop with a simulated plant: (a) wanted angle, plant (lines) and camera values "
        "(dots), (b) the pressure, (c) the wall time of the controller in each tick and the period, "
        f"{MS / run.rate:.3g} ms (dashed)."
    )
