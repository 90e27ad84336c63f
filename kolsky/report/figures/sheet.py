"""Figures of a fitted sheet: forces, misfit, constants of each step, sensitivities."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.tri import Triangulation

from kolsky.base.arrays import BoolArray, FloatArray
from kolsky.report.figures.base import (
    FORCE,
    GREY,
    MEASURED,
    MM,
    MODEL,
    PAGE,
    SHAPE,
    FigureKind,
    Panels,
    label_panel,
    note_empty,
    smooth_bar,
)
from kolsky.report.nomenclature import constant_symbol
from kolsky.report.specimen_view import SheetView

MN = 1e3
"""Newtons to millinewtons."""


def draw_histories(view: SheetView, panels: Panels) -> None:
    """Draw force and misfit over the pad's displacement."""
    found = view.fit
    data, pad = found.problem.data, MM * np.abs(found.problem.data.pad)
    ax = panels["force"]
    label_panel(ax, "a")
    ax.plot(pad, MN * np.abs(data.force), "o", color=MEASURED, mfc="none", ms=3, label="measured")
    ax.plot(pad, MN * np.abs(found.cost.state.force), "-", color=MODEL, label="simulated")
    ax.set_ylabel("pad force (mN)")
    ax.legend(frameon=False)
    ax = panels["misfit"]
    label_panel(ax, "b")
    ax.plot(pad, 100.0 * found.misfit, "o-", color=SHAPE, ms=3, label="misfit")
    ax.plot(pad, 100.0 * found.noise, "--", color=GREY, label="noise alone")
    ax.set_ylabel("displacement misfit (%)")
    ax.set_ylim(bottom=0.0)
    ax.legend(frameon=False)
    for one in (panels["force"], panels["misfit"]):
        one.set_xlabel("pad displacement (mm)")


def caption_histories(view: SheetView) -> str:
    """Return the caption."""
    return (
        "(a) Force on the pad. (b) Root mean square of simulated less measured displacements over the "
        "measured "
        "ones in the measured region, and what the noise of the points would make of it."
    )


def draw_steps(view: SheetView, panels: Panels) -> None:
    """Draw the constants of every step fitted alone, and their sensitivities to noise."""
    found, free = view.fit, view.fit.constants.free
    pad = MM * np.abs(found.problem.data.pad)
    by_u, by_f = found.relative_by_displacement(1e-6), found.relative_by_force(1e-3)
    for j, name in enumerate(free):
        ax = panels[name]
        label_panel(ax, "abcd"[j])
        scale = 1e-3 if found.constants.free_specs[j].unit == "Pa" else 1.0
        unit = " (kPa)" if scale != 1.0 else ""
        alone = [np.nan if isinstance(step, str) else scale * step.values[j] for step in view.steps]
        if alone:
            ax.plot(pad, alone, "o", color=MEASURED, mfc="none", ms=3, label="step alone")
        ax.axhline(scale * found.values[j], color=MODEL, label="all steps")
        ax.set_ylabel(f"{constant_symbol(name)}{unit}")
        ax.legend(frameon=False)
        other = panels[f"{name} noise"]
        label_panel(other, "abcdefgh"[len(free) + j])
        if found.at_bound[j]:
            note_empty(other, "at its bound")
        else:
            _draw_noise(other, pad, by_u[:, j], by_f[:, j], constant_symbol(name))
        for one in (ax, other):
            one.set_xlim(0.0, 1.05 * pad.max())
            one.set_xlabel("pad displacement (mm)")


def _draw_noise(ax: Axes, pad: FloatArray, by_u: FloatArray, by_f: FloatArray, name: str) -> None:
    floor = 1e-9
    ax.semilogy(pad, 100.0 * np.maximum(by_u, floor), "o-", color=SHAPE, ms=3, label="1 µm")
    ax.semilogy(pad, 100.0 * np.maximum(by_f, floor), "s-", color=FORCE, ms=3, label="1 mN")
    ax.set_ylabel(f"relative deviation of {name} (%)")
    ax.legend(frameon=False, title="noise of")


def caption_steps(view: SheetView) -> str:
    """Return the caption."""
    return (
        "Upper row: constants fitted to each step alone and to all together; a drift shows that the law "
        "is not the "
        "material's. Lower row: standard deviation of each constant over its value from noise of the "
        "displacement "
        "of every node (1 µm) and of the force (1 mN) in one step, Eqs. (20) to (25) of Sutula et al. (2020)."
    )


def _field(
    ax: Axes,
    view: SheetView,
    value: FloatArray,
    vectors: FloatArray | None,
    label: str,
    near: BoolArray | None = None,
) -> None:
    points, cells = MM * view.mesh.points, view.mesh.cells[:, :3]
    image = ax.tripcolor(
        Triangulation(points[:, 0], points[:, 1], cells),
        value,
        cmap="viridis",
        shading="gouraud",
        rasterized=True,
    )
    if vectors is not None:
        size = np.linalg.norm(vectors, axis=1)
        seen = np.flatnonzero(size > 0.02 * size.max())
        chosen = seen[:: max(1, len(seen) // 150)]
        ax.quiver(
            points[chosen, 0],
            points[chosen, 1],
            vectors[chosen, 0],
            vectors[chosen, 1],
            color="white",
            width=0.003,
        )
    if near is not None:
        (x0, y0), (x1, y1) = points[near].min(axis=0), points[near].max(axis=0)
        gap = 0.05 * max(x1 - x0, y1 - y0)
        ax.set_xlim(x0 - gap, x1 + gap)
        ax.set_ylim(y0 - gap, y1 + gap)
    ax.set_aspect("equal")
    ax.set_xlabel("$x$ (mm)")
    ax.set_ylabel("$y$ (mm)")
    smooth_bar(ax.figure.colorbar(image, ax=ax, label=label, fraction=0.03))


def draw_fields(view: SheetView, panels: Panels) -> None:
    """Draw displacement, misfit, sensitivity and the map before the test."""
    found = view.fit
    state, data = found.cost.state, found.problem.data
    inside = np.zeros(len(view.mesh.points), dtype=bool)
    inside[view.mesh.cells[data.cells].ravel()] = True
    u = state.displacements[-1]
    _field(panels["u"], view, MM * np.linalg.norm(u, axis=1), None, "displacement (mm)")
    apart = np.where(inside[:, None], u - data.displacements[-1], 0.0)
    _field(panels["misfit"], view, MM * np.linalg.norm(apart, axis=1), apart, "misfit (mm)", inside)
    weakest = int(np.argmax(np.linalg.norm(view.sensitivity, axis=(1, 2))))
    own = view.sensitivity[weakest] * 1e-9
    name = constant_symbol(found.constants.free[weakest])
    _field(panels["sensitivity"], view, np.linalg.norm(own, axis=1), own, f"{name} (1/mm$^3$)", inside)
    n = len(view.mesh.points)
    best = view.before.field[-1].reshape(2, n).T * 1e-9
    _field(panels["before"], view, np.linalg.norm(best, axis=1), best, "whole sheet (1/mm$^3$)")
    for letter, name in zip("abcd", ("u", "misfit", "sensitivity", "before"), strict=True):
        label_panel(panels[name], letter)


def caption_fields(view: SheetView) -> str:
    """Return the caption."""
    fit = view.fit
    names = [name for name, held in zip(fit.constants.free, fit.at_bound, strict=True) if not held]
    if view.before.singular:
        parts = [
            f"{weight:+.2f} {name}" for weight, name in zip(view.before.directions[-1], names, strict=True)
        ]
        of = f"the one combination of relative constants that displacements see ({', '.join(parts)})"
    else:
        of = names[-1]
    return (
        "Last step. (a) Simulated displacement. (b) Simulated less measured displacement in the "
        "measured region. "
        "(c) Relative change of the constant that displacements move most, as a field over the measured "
        "displacements, Eqs. (26) and (27) of Sutula et al. (2020). (d) The same for a measurement of "
        "the whole "
        f"sheet, before it is made, for {of}, Eqs. (28) to (36)."
    )


def draw_map(view: SheetView, panels: Panels) -> None:
    """Draw the factors of stiffness."""
    assert view.stiffness is not None  # `applies` has looked
    ax, points = panels["map"], MM * view.mesh.points
    image = ax.tripcolor(
        Triangulation(points[:, 0], points[:, 1], view.mesh.cells[:, :3]),
        facecolors=view.stiffness.factors[view.stiffness.regions],
        cmap="viridis",
        rasterized=True,
    )
    ax.set_aspect("equal")
    ax.set_xlabel("$x$ (mm)")
    ax.set_ylabel("$y$ (mm)")
    smooth_bar(ax.figure.colorbar(image, ax=ax, label="stiffness over the fitted one", fraction=0.03))


def caption_map(view: SheetView) -> str:
    """Return the caption."""
    assert view.stiffness is not None
    words = "explains" if view.stiffness.explained else "does not explain"
    return (
        "Factor of all moduli of each block, the smoothest map by total variation; it "
        f"{words} the field within its noise."
    )


FIGURES = (
    FigureKind(
        name="sheet-map",
        width=PAGE,
        height=lambda view: 70.0,
        caption=caption_map,
        panels=lambda view: [["map"]],
        draw=draw_map,
        applies=lambda view: view.stiffness is not None,
    ),
    FigureKind(
        name="sheet-histories",
        width=PAGE,
        height=lambda view: 62.0,
        caption=caption_histories,
        panels=lambda view: [["force", "misfit"]],
        draw=draw_histories,
    ),
    FigureKind(
        name="sheet-steps",
        width=PAGE,
        height=lambda view: 110.0,
        caption=caption_steps,
        panels=lambda view: [
            list(view.fit.constants.free),
            [f"{name} noise" for name in view.fit.constants.free],
        ],
        draw=draw_steps,
    ),
    FigureKind(
        name="sheet-fields",
        width=PAGE,
        height=lambda view: 95.0,
        caption=caption_fields,
        panels=lambda view: [["u", "misfit"], ["sensitivity", "before"]],
        draw=draw_fields,
    ),
)
