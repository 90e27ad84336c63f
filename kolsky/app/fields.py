"""Measured fields over the pictures, and a selected point over time."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from nicegui import ui

from dic.outcome import PointOutcome
from dic.surfaces.strains import StrainOutcome
from kolsky.app import frame
from kolsky.report.surface_maps import COLOURS, OUTCOME_COLOURS, limits_of, map_png, scale_colours
from kolsky.shot.measured_points import OUTCOME, MeasuredPoints

NO_FIELD = ""
OPACITY = 0.8
"""Opacity of a map [-]; the speckles remain visible."""
FIRST_FIELD = "Eyy"


class FieldsView:
    """Selection of a field, its maps and scale, and one point over time."""

    def __init__(
        self, surfaces: tuple[MeasuredPoints, ...], shape: tuple[int, int], changed: Callable[[], None]
    ) -> None:
        """Build the view without a field. `changed` redraws the pictures."""
        self.surfaces, self.shape, self.changed = surfaces, shape, changed
        self.points = surfaces[0]
        self.field = NO_FIELD
        self.chosen: int | None = None
        self.k = 0

    def controls(self) -> None:
        """Create the selection of surface and field, with the colour scale."""
        with ui.row().classes("w-full items-center gap-3"):
            if len(self.surfaces) > 1:
                names = {i: one.name for i, one in enumerate(self.surfaces)}
                surface = frame.choice(names, 0, "Surface", width="w-36").mark("surface")
                surface.on_value_change(lambda change: self._surface(change.value))
            self.select = frame.choice(self._options(), self.field, "Colour of the pictures", width="w-72")
            self.select.mark("field").on_value_change(lambda change: self._choose_field(str(change.value)))
            self.scale = ui.html(sanitize=False).classes("grow")

    def panels(self) -> None:
        """Create the plot of a point over time."""
        with ui.column().classes("w-full gap-1"):
            frame.heading("One point over time")
            self.about = frame.note("Click on the surface in a picture to choose a point.").mark("point")
            self.plot = frame.chart("Time", "", [], words="The chosen point over time")
            for key in ("xAxis", "yAxis"):
                self.plot.options[key]["axisLine"]["onZero"] = False
            self.plot.set_visibility(False)

    def _options(self) -> dict[str, str]:
        return {NO_FIELD: "none", **{name: one.label for name, one in self.points.fields.items()}}

    def _surface(self, number: int) -> None:
        self.points, self.chosen = self.surfaces[number], None
        if self.field not in self.points.fields:
            self.field = NO_FIELD
        self.select.set_options(self._options(), value=self.field)
        self._choose_field(self.field)

    def _choose_field(self, name: str) -> None:
        self.field = name
        self._point()
        self._scale()
        self.changed()

    @property
    def followed(self) -> str:
        """The field of the plot over time: the coloured field, or the strain along y."""
        known = self.points.fields
        if self.field not in (NO_FIELD, OUTCOME):
            return self.field
        return FIRST_FIELD if FIRST_FIELD in known else "V"

    def at(self, k: int) -> None:
        """Go to a frame."""
        self.k = min(k, self.points.surface.n_frames - 1)
        if self.field == OUTCOME:
            self._scale()
        if self.chosen is not None:
            self._mark_time()
            self._describe()

    def overlay(self, camera: int) -> str:
        """The map and the selected point's path over a camera's picture, as SVG."""
        parts = []
        rows, columns = self.shape
        if self.field and camera < len(self.points.pixels):
            limits = limits_of(self.points.fields[self.field])
            png = map_png(self.points, self.field, self.k, camera=camera, shape=self.shape, limits=limits)
            parts.append(
                f'<image href="{frame.data_uri(png)}" x="-.5" y="-.5" width="{columns}" height="{rows}" '
                f'opacity="{OPACITY}"/>'
            )
        if self.chosen is not None and camera < len(self.points.pixels):
            parts.append(path_svg(self.points, self.chosen, camera, self.k, columns / 400.0))
        return "".join(parts)

    def choose(self, camera: int, place: tuple[float, float]) -> None:
        """Select the point nearest to a position in a picture."""
        if camera >= len(self.points.pixels):
            return
        self.chosen = self.points.nearest(camera, self.k, place)
        self._point()

    def _scale(self) -> None:
        """Show the colour scale or legend."""
        if not self.field:
            self.scale.content = ""
        elif self.field == OUTCOME:
            self.scale.content = outcome_legend(self.points.outcomes(self.k))
        else:
            low, high = limits_of(self.points.fields[self.field])
            self.scale.content = scale_html(low, high, self.points.fields[self.field].unit)

    def _point(self) -> None:
        """Draw the selected point over time."""
        self.plot.set_visibility(self.chosen is not None)
        if self.chosen is None:
            return
        one, points = self.points.fields[self.followed], self.points
        t, y = time_of(points), one.values[:, self.chosen]
        series = []
        if one.sigma is not None:
            spread = 2.0 * one.sigma[:, self.chosen]
            series += frame.band("± 2σ", t, y - spread, y + spread)
        series.append(frame.line("measured", frame.points(t, y), frame.INK))
        self.plot.options["series"] = series
        self.plot.options["xAxis"]["name"] = "Time (µs)" if points.timed else "Frame"
        self.plot.options["yAxis"]["name"] = f"{one.symbol} ({one.unit})"
        self._mark_time()
        self._describe()

    def _mark_time(self) -> None:
        frame.mark_at(self.plot.options["series"][-1], time_of(self.points)[self.k])
        self.plot.update()

    def _describe(self) -> None:
        assert self.chosen is not None
        self.about.text = point_words(self.points, self.chosen, self.k, self.followed)


def time_of(points: MeasuredPoints) -> np.ndarray:
    """Times for a plot: in µs, or frame numbers."""
    return (1e6 if points.timed else 1.0) * points.surface.t


def scale_html(low: float, high: float, unit: str, colours: str = COLOURS) -> str:
    """The scale of a colour map with its limits, as HTML."""
    stops = ", ".join(scale_colours(colours))
    digits = max(0, 2 - math.floor(math.log10(high - low)))
    first, last = (f'<span class="soft">{v:.{digits}f} {unit}</span>' for v in (low, high))
    look = f"flex:1;height:.7rem;max-width:16rem;background:linear-gradient(90deg,{stops})"
    return (
        f'<div style="display:flex;gap:.5rem;align-items:center">{first}<span style="{look}"></span>{last}'
        "</div>"
    )


def outcome_legend(counts: dict[PointOutcome, int]) -> str:
    """The colours of the outcomes of a frame, with the number of points of each."""
    parts = [
        f'<span class="soft" title="{one.cause}. {one.cure}">'
        f'<span style="color:{OUTCOME_COLOURS[one]}" aria-hidden="true">●</span> '
        f"{one.name.lower().replace('_', ' ')} {count}</span>"
        for one, count in counts.items()
    ]
    return f'<div style="display:flex;flex-wrap:wrap;gap:.1rem .8rem">{"".join(parts)}</div>'


def path_svg(points: MeasuredPoints, number: int, camera: int, k: int, width: float) -> str:
    """The path of a point in a camera's picture up to a frame, and its position. A lost point is hollow."""
    places = points.pixels[camera][: k + 1, number]
    known = places[np.isfinite(places).all(axis=1)]
    if not len(known):
        return ""
    line = " ".join(f"{x:.2f},{y:.2f}" for x, y in known)
    x, y = known[-1]
    fill = frame.ORANGE if points.surface.valid[k, number] else "none"
    return (
        f'<polyline points="{line}" fill="none" stroke="{frame.ORANGE}" stroke-width="{width:g}"/>'
        f'<circle cx="{x:.2f}" cy="{y:.2f}" r="{3.0 * width:g}" fill="{fill}" stroke="#fff" '
        f'stroke-width="{0.8 * width:g}"/>'
    )


def point_words(points: MeasuredPoints, number: int, k: int, name: str) -> str:
    """The value of a point in a frame, or the reason why there is none, in words."""
    x, y = points.reference[number]
    head = f"Point {number}, at ({x:.0f}, {y:.0f}) px of the reference: "
    outcome = PointOutcome(int(points.surface.outcome[k, number]))
    if not outcome.ok:
        return f"{head}lost in frame {k}, {outcome.cause}; {outcome.cure}."
    one = points.fields[name]
    value = one.values[k, number]
    if not np.isfinite(value):
        assert points.strain is not None  # of a point that was found, only a strain can be missing
        cause = StrainOutcome(int(points.strain.outcome[k, number]))
        return f"{head}no strain in frame {k}, {cause.cause}; {cause.cure}."
    spread = "" if one.sigma is None else f" ± {2.0 * one.sigma[k, number]:.2g}"
    unit = f" {one.unit}" if one.unit else ""
    places = "; ".join(
        f"camera {i} at ({at[k, number, 0]:.2f}, {at[k, number, 1]:.2f}) px"
        for i, at in enumerate(points.pixels)
    )
    k2 = "" if one.sigma is None else " (k = 2)"
    return f"{head}{one.symbol} = {value:.4g}{spread}{unit}{k2} in frame {k}; {places}."
