"""Figures of a full-field measurement: fields on the picture, and histories."""

import numpy as np
from matplotlib.ticker import MaxNLocator

from kolsky.base.arrays import FloatArray
from kolsky.report.figures.base import (
    BAND,
    GREY,
    MEASURED,
    MM,
    MODEL,
    MS,
    PAGE,
    SHAPE,
    FigureKind,
    Panels,
    label_panel,
    label_text,
    note_empty,
    smooth_bar,
)
from kolsky.report.full_field_view import FullFieldView

FIELDS = {"motion": "displacement", "exx": "$E_{xx}$ (%)", "eyy": "$E_{yy}$ (%)", "exy": "$E_{xy}$ (%)"}
LINES = (MEASURED, MODEL, SHAPE, BAND, GREY)
"""Colours of extensometers, in turn."""


def _unit(view: FullFieldView) -> tuple[float, str]:
    """Factor and name of the unit of lengths."""
    return (MM, "mm") if view.result.unit == "m" else (1.0, "px")


def _field(view: FullFieldView, name: str) -> FloatArray:
    """Values of a field in the frame shown, shape [n_points]."""
    result, k = view.result, view.frame
    if name == "motion":
        return np.asarray(_unit(view)[0] * np.linalg.norm(result.surface.u[k], axis=1))
    return np.asarray(100.0 * result.strain.value[k, :, ("exx", "eyy", "exy").index(name)])


def _height(view: FullFieldView) -> float:
    x, y = np.ptp(view.result.points, axis=0) + 2.0 * view.result.facts.get("subset", 21)
    return float(np.clip(2.0 * (0.36 * PAGE * y / x + 14.0), 60.0, 220.0))


def draw_fields(view: FullFieldView, panels: Panels) -> None:
    """Draw displacement and strains over the picture of the frame shown."""
    result = view.result
    room = result.facts.get("subset", 21)
    at = result.pixels[0, view.frame]
    seen = np.isfinite(at).all(axis=1) & result.surface.valid[view.frame]
    for (name, label), mark in zip(FIELDS.items(), "abcd", strict=True):
        ax = panels[name]
        if view.picture is not None:
            low, high = np.percentile(np.asarray(view.picture, dtype=np.float64), [0.5, 99.5])
            ax.imshow(view.picture, cmap="gray", vmin=low, vmax=max(high, low + 1), interpolation="none")
        label_panel(ax, mark)
        ax.set_xlabel("$x$ (px)")
        ax.set_ylabel("$y$ (px)")
        values = _field(view, name)
        shown = seen & np.isfinite(values)
        if not shown.any():
            note_empty(ax, "no point has a value")
            continue
        (x0, y0), (x1, y1) = at[shown].min(axis=0) - room, at[shown].max(axis=0) + room
        ax.set_xlim(x0, x1)
        ax.set_ylim(y1, y0)
        low, high = np.percentile(values[shown], [1.0, 99.0])
        if high - low < 1e-9 * max(abs(high), 1.0):
            low, high = low - 0.5, high + 0.5
        size = 72.0 / 25.4 * 0.36 * PAGE * result.facts.get("step", 5) / max(x1 - x0, 1.0)
        points = ax.scatter(
            at[shown, 0], at[shown, 1], c=values[shown], s=max(0.5 * size, 0.8) ** 2, cmap="viridis",
            vmin=low, vmax=high, linewidths=0, rasterized=True,
        )  # fmt: skip
        bar = ax.figure.colorbar(points, ax=ax, fraction=0.05, pad=0.02)
        bar.set_label(f"displacement ({_unit(view)[1]})" if name == "motion" else label)
        smooth_bar(bar)


def caption_fields(view: FullFieldView) -> str:
    """Return the caption."""
    facts = view.result.facts
    return (
        f"Frame {view.frame} of camera 0 with (a) the size of the displacement since the reference and "
        f"(b) to (d) the Green-Lagrange strains over gauges of {facts.get('strain_gauge', 0):g} px; subsets "
        f"of {facts.get('subset')} px, {facts.get('step')} px apart. Colours span 98 % of the values."
    )


def _has_lines(view: FullFieldView) -> bool:
    return bool(view.result.surface.n_frames > 1)


def _time(view: FullFieldView) -> tuple[FloatArray, str]:
    result = view.result
    return (MS * result.surface.t, "$t$ (ms)") if result.timed else (result.surface.t, "frame")


def _panels(view: FullFieldView) -> list[list[str]]:
    return [["mean", "extensometers"] if view.result.extensions else ["mean"]] + (
        [["radius", "radius"] if view.result.extensions else ["radius"]] if view.result.cylinder else []
    )


def draw_histories(view: FullFieldView, panels: Panels) -> None:
    """Draw mean strains, extensometers and radius over time."""
    result, (t, label) = view.result, _time(view)
    mean, ax = 100.0 * result.mean_strain, panels["mean"]
    for k, (name, colour) in enumerate(zip(("xx", "yy", "xy"), (MODEL, MEASURED, GREY), strict=True)):
        ax.plot(t, mean[:, k], ".-", color=colour, label=f"$E_{{{name}}}$", markersize=3)
    ax.set_ylabel("mean strain (%)")
    ax.set_xlabel(label)
    ax.legend(frameon=False)
    label_panel(ax, "a")
    if result.extensions:
        ax = panels["extensometers"]
        factor, unit = _unit(view)
        for k, one in enumerate(result.extensions):
            colour = LINES[k % len(LINES)]
            ax.errorbar(
                t, factor * one.elongation, 2.0 * factor * one.sigma, fmt=".-", color=colour, markersize=3,
                label=label_text(one.name, 24), elinewidth=0.8,
            )  # fmt: skip
        ax.set_ylabel(f"elongation ({unit})")
        ax.set_xlabel(label)
        ax.legend(frameon=False)
        label_panel(ax, "b")
    if result.cylinder is not None:
        ax, mark = panels["radius"], "c" if result.extensions else "b"
        ax.errorbar(t, MM * result.cylinder.radius, 2.0 * MM * result.cylinder.sigma, fmt=".", color=MEASURED)
        ax.ticklabel_format(axis="y", useOffset=False)
        ax.set_ylabel("radius (mm)")
        ax.set_xlabel(label)
        label_panel(ax, mark)
    if not result.timed:
        for ax in panels.values():
            ax.xaxis.set_major_locator(MaxNLocator(integer=True))


def caption_histories(view: FullFieldView) -> str:
    """Return the caption."""
    text = "(a) Mean of the strains of all points."
    if view.result.extensions:
        text += " (b) Virtual extensometers."
    if view.result.cylinder is not None:
        text += (
            f" ({'c' if view.result.extensions else 'b'}) Radius of the cylinder that fits each frame best."
        )
    return text + " Bars: ± 2 standard deviations from the noise of the matches."


FIGURES = (
    FigureKind(
        name="full-field",
        width=PAGE,
        height=_height,
        caption=caption_fields,
        panels=lambda view: [["motion", "exx"], ["eyy", "exy"]],
        draw=draw_fields,
    ),
    FigureKind(
        name="histories",
        width=PAGE,
        height=lambda view: 110.0 if view.result.cylinder else 60.0,
        caption=caption_histories,
        panels=_panels,
        draw=draw_histories,
        applies=_has_lines,
    ),
)
