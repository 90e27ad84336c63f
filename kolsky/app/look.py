"""The view of a result.

Force, outline and specimen linked in time, what-if parameters, causes.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from nicegui import ui

from kolsky.app import frame
from kolsky.app.copies import changed_value, copy_of, copy_with
from kolsky.app.draft import Draft
from kolsky.app.fields import scale_html
from kolsky.app.what_if import Answer, Misfit, WhatIf
from kolsky.base.errors import InputError
from kolsky.inverse.parameters import PARAMETERS
from kolsky.inverse.result import FORCE, OUTLINE, CauseFinding, Estimate, Identification
from kolsky.pictures.picture_set import PictureSet
from kolsky.report.result_folder import RESULT_FILE
from kolsky.report.scene.drawing import picture, png_of
from kolsky.report.scene.scene_data import FIELDS, Scene, SceneDataMissing, scene_of, solid_of
from kolsky.results.hdf5 import read_identification
from kolsky.results.nomenclature import factor_of
from kolsky.results.printed import answer, fit_line
from kolsky.schema.shot_file import SHOT_FILE
from kolsky.shot.load import load_pictures, load_shot
from kolsky.shot.optical_data import measured
from kolsky.shot.records import Shot

LEAST_EXPLAINED = 0.05
"""Smallest share of the misfit that an input must explain to be listed [-]. Smaller shares are within the
noise."""
SECONDS_OF_PLAY = 0.12
"""Time between two pictures of the playback [s]."""
PICTURE_WIDTH = 640
"""Maximum width of a camera's picture beside the plots [px]. It equals the displayed width."""
EXPECTED = "expected scatter, k = 2"
"""Name of the band about the measured force."""


@dataclass
class Result:
    """A result with its shot, for a page."""

    folder: Path
    found: Identification
    shot: Shot | None
    why: str
    """Reason why the shot is missing; empty if it is present."""
    pictures: PictureSet | None = None
    """The shot's pictures. None if it has none, or if they cannot be opened."""


def read_result(folder: Path) -> Result:
    """Read the result of a shot and, for simulations, the shot. Raises InputError if there is no result."""
    results = folder / "results"
    found = read_identification(results / RESULT_FILE)
    try:
        shot = load_shot(folder, measure=partial(measured, folder=results))
    except InputError as error:
        return Result(folder, found, None, str(error))
    differing = [n for n, sha in found.provenance.get("inputs", {}).items() if shot.inputs.get(n) != sha]
    why = f"{', '.join(differing[:3])} changed since this result was made: identify again"
    pictures = None
    if "pictures" in Draft(folder / SHOT_FILE).content():
        with suppress(InputError):  # the pictures page gives the reason
            pictures = load_pictures(folder).pictures
    return Result(folder, found, shot, why if differing else "", pictures)


def page(root: Path) -> None:
    """Register the page."""

    @ui.page("/look", response_timeout=30.0)
    async def look_page(shot: str = "") -> None:
        with frame.framed(f"Look at {shot}", view="look", shot=shot):
            folder = frame.folder_at(root, shot)
            if not (folder / "results" / RESULT_FILE).is_file():
                frame.note("There is no result yet: run identify first.")
                ui.link("Run", frame.address("run", shot))
                return
            LookView(await frame.opened("The result is read ...", read_result, folder), shot)


class LookView:
    """Estimates, plots over time, what-if and causes of one result."""

    def __init__(self, result: Result, name: str) -> None:
        """Build the view."""
        self.result, self.name, self.found = result, name, result.found
        self.k = 0
        self.field = "stretch"
        self.scenes: dict[str, Scene] = {}
        self.tried: Answer | None = None
        self.what_if: WhatIf | None = None
        self._answer()
        frame.heading("Over time")
        self._over_time()
        frame.heading("What if")
        self._what_if()
        self._causes()

    def _answer(self) -> None:
        with ui.column().classes("answer gap-0"):
            for i, e in enumerate(self.found.estimates.values()):
                with ui.element("b" if i == 0 else "p"):
                    ui.label(answer_words(e))
            frame.note(fit_line(self.found))
        if self.result.why:
            frame.note(self.result.why, "caution")
        if self.found.warnings:
            count = len(self.found.warnings)
            with frame.fold("1 warning" if count == 1 else f"{count} warnings"):
                for words in self.found.warnings:
                    frame.note(words, "caution")
        if (self.result.folder / "results" / "report.html").is_file():
            target = frame.address("result", self.name, name="report.html")
            ui.link("report.html, the whole result on one page", target, new_tab=True)

    def _scene(self) -> Scene | None:
        """The simulated specimen with the selected field. None if the result does not contain it."""
        if self.field not in self.scenes:
            shot, found = self.result.shot, self.found
            values = {**found.fixed, **{name: e.value for name, e in found.estimates.items()}}
            try:
                solid = None if shot is None else solid_of(shot.curve, values)
                self.scenes[self.field] = scene_of(self.found, field=self.field, solid=solid)
            except (SceneDataMissing, ValueError):
                return None
        return self.scenes[self.field]

    def _over_time(self) -> None:
        c = self.found.comparison
        self.times = np.unique(c.centre_line.time) if c.centre_line.time.size else c.force_time
        self.k = len(self.times) - 1
        step = max(1, len(self.times) // 60)
        self.player = frame.Player(
            len(self.times), self._at, words="Time", every=SECONDS_OF_PLAY, first=self.k, step=step
        )
        with ui.element("div").classes("grid2"):
            self.force = self._force_plot()
            self.residual = self._residual_plot()
            self.outline = self._outline_plot() if c.centre_line.time.size else None
            self._specimen()
            series = self.result.pictures.series if self.result.pictures is not None else ()
            self.cameras = [frame.camera(i) for i in range(len(series))]
        self._at(self.k)

    def _force_plot(self) -> ui.echart:
        c, spread = self.found.comparison, self.found.spread(FORCE)
        t = 1e6 * c.force_time
        low, high = c.force_measured - 2.0 * spread, c.force_measured + 2.0 * spread
        plot = frame.chart(
            "Time (µs)",
            "Transmitted force (N)",
            [
                *frame.band(EXPECTED, t, low, high),
                frame.dots("measured", frame.points(t, c.force_measured), frame.INK, 3.5, z=4),
                frame.line("model", frame.points(t, c.force_model), frame.ORANGE),
                frame.line("tried", [], frame.BLUE),
            ],
            words="Transmitted force over time, measured and simulated",
        )
        band = {"name": EXPECTED, "icon": "rect"}
        plot.options["legend"]["data"] = [band, "measured", "model", "tried"]
        return plot

    def _residual_plot(self) -> ui.echart:
        c = self.found.comparison
        t = 1e6 * c.force_time
        force = (c.force_measured - c.force_model) / self.found.spread(FORCE)
        series = [frame.line("force", frame.points(t, force), frame.INK)]
        line = c.centre_line
        if line.time.size:
            over = np.where(c.inside, (line.Z - c.Z_model) / self.found.spread(OUTLINE), np.nan)
            of_frames = (over[(line.time == one) & np.isfinite(over)] for one in self.times)
            rms = [float(np.sqrt(np.mean(one**2))) if one.size else np.nan for one in of_frames]
            data = frame.points(1e6 * self.times, rms)
            series.append(frame.line("outline, rms of a frame", data, frame.BLUE))
        area = [[{"yAxis": -2.0, "itemStyle": {"color": frame.BAND}}, {"yAxis": 2.0}]]
        series[0]["markArea"] = {"silent": True, "data": area}
        plot = frame.chart(
            "Time (µs)",
            "Residual over its expected spread",
            series,
            words="Residual of force and outline over time",
        )
        largest = max(abs(v[1]) for one in series for v in one["data"] if v[1] is not None)
        plot.options["yAxis"] |= {"min": -np.ceil(max(largest, 3.0)), "max": np.ceil(max(largest, 3.0))}
        return plot

    def _outline_plot(self) -> ui.echart:
        line = self.found.comparison.centre_line
        plot = frame.chart(
            "Radius Z (mm)",
            "Height y (mm)",
            [
                frame.dots("measured", [], frame.INK, 4),
                frame.line("model", [], frame.ORANGE),
                frame.line("tried", [], frame.BLUE),
            ],
            words="Outline of the specimen at the chosen time, measured and simulated",
        )
        low, high = 2e3 * line.Z.min(), 2e3 * line.Z.max()  # whole halves of a millimetre around all frames
        plot.options["xAxis"] |= {"min": float(np.floor(low)) / 2.0, "max": float(np.ceil(high)) / 2.0}
        plot.options["yAxis"] |= {"min": 0, "max": float(np.ceil(2e3 * line.y.max())) / 2.0}
        return plot

    def _specimen(self) -> None:
        with ui.column().classes("w-full gap-1"):
            self.drawing = ui.interactive_image().classes("w-full").mark("specimen")
            frame.described(self.drawing, "Cut through the specimen, coloured by a field")
            if self._scene() is None:
                return
            names = {
                name: kind.label for name, kind in FIELDS.items() if not kind.needs_solid or self.result.shot
            }
            chosen = frame.choice(names, self.field, "Colour", width="w-64")
            chosen.on_value_change(lambda change: self._colour(str(change.value)))
            self.scale = ui.html(sanitize=False).classes("w-full")

    def _colour(self, field: str) -> None:
        self.field = field
        self._at(self.k)

    def _at(self, k: int) -> None:
        """Show everything at a time."""
        self.k, now = k, float(self.times[k])
        self.player.now.text = f"{1e6 * now:.1f} µs"
        for plot, last in ((self.force, -2), (self.residual, -1)):
            frame.mark_at(plot.options["series"][last], 1e6 * now)
            plot.update()
        if self.outline is not None:
            self._outline_at(now)
        scene = self._scene()
        if scene is not None:
            pixels = picture(scene, int(np.argmin(np.abs(scene.times - now))), axes=False)
            self.drawing.set_source(frame.data_uri(png_of(pixels)))
            self.scale.content = scale_html(*scene.limits, "", FIELDS[self.field].colours)
        if self.result.pictures is not None:
            nearest = int(np.argmin(np.abs(self.result.pictures.time - now)))
            for image, pictures in zip(self.cameras, self.result.pictures.series, strict=True):
                image.set_source(frame.source_of(pictures, nearest, PICTURE_WIDTH))

    def _outline_at(self, now: float) -> None:
        assert self.outline is not None
        c = self.found.comparison
        points = np.flatnonzero(c.centre_line.time == now)
        points = points[np.argsort(c.centre_line.y[points])]
        y = 1e3 * c.centre_line.y[points]
        series = self.outline.options["series"]
        series[0]["data"] = frame.points(1e3 * c.centre_line.Z[points], y)
        series[1]["data"] = frame.points(1e3 * np.where(c.inside[points], c.Z_model[points], np.nan), y)
        if self.tried is not None and self.what_if is not None:
            line = self.what_if.prepared.observations.centre_line  # of the present files of the shot
            points = np.flatnonzero(line.time == line.time[np.argmin(np.abs(line.time - now))])
            points = points[np.argsort(line.y[points])]
            Z = np.where(self.tried.prediction.inside[0, points], self.tried.prediction.Z[0, points], np.nan)
            series[-1]["data"] = frame.points(1e3 * Z, 1e3 * line.y[points])
        self.outline.update()

    def _what_if(self) -> None:
        if self.result.shot is None:
            frame.note(f"The shot cannot be read, so nothing can be simulated: {self.result.why}", "caution")
            return
        try:
            self.what_if = WhatIf(self.result.shot, self.found)
        except ValueError as error:
            frame.note(str(error), "caution")
            return
        frame.note(
            "Move a slider: the shot is simulated with these values on the mesh of the search, and the plots "
            "above show it in blue. Residuals are divided by those expected of a correct model: 1 is as "
            "expected."
        )
        self.sliders: dict[str, ui.slider] = {}
        with ui.column().classes("w-full gap-1"):
            for name, value in self.what_if.start.items():
                self._slider(name, value)
            ui.button("Back to the answer", on_click=self._back).props("flat dense")
            self.said = ui.label().props("role=status").mark("misfit")

    def _slider(self, name: str, value: float) -> None:
        assert self.what_if is not None
        low, high = self.what_if.bounds(name)
        factor, words = factor_of(name), PARAMETERS[name].words
        unit = "" if PARAMETERS[name].shown_unit == "1" else f" {PARAMETERS[name].shown_unit}"
        with ui.row().classes("w-full items-center no-wrap gap-3"):
            ui.label(PARAMETERS[name].written).classes("w-6")
            slider = ui.slider(
                min=low * factor, max=high * factor, step=(high - low) * factor / 200.0, value=value * factor
            )
            slider.props(f'aria-label="{words}"').mark(f"what-if-{name}")
            ui.label().classes("w-28 text-right").bind_text_from(slider, "value", lambda v: f"{v:.5g}{unit}")
        slider.on("change", self._simulate)
        self.sliders[name] = slider

    def _values(self) -> dict[str, float]:
        return {name: float(slider.value) / factor_of(name) for name, slider in self.sliders.items()}

    def _back(self) -> None:
        assert self.what_if is not None
        for name, slider in self.sliders.items():
            slider.value = self.what_if.start[name] * factor_of(name)
        self.tried = None
        self.said.text = ""
        for plot in (self.force, self.outline):
            if plot is not None:
                plot.options["series"][-1]["data"] = []
        self._at(self.k)

    async def _simulate(self, _: object = None) -> None:
        """Simulate with the sliders' values and show the result, of overlapping calls that of the last."""
        assert self.what_if is not None
        values = self._values()
        try:
            tried = await frame.in_thread(self.what_if.run, values)
            reference = await frame.in_thread(self.what_if.run, self.what_if.start)
        except ValueError as error:
            self.said.text = str(error)
            return
        if values != self._values():
            return
        self.tried = tried
        observed = self.what_if.prepared.observations
        self.force.options["series"][-1]["data"] = frame.points(
            1e6 * observed.force_times, tried.prediction.force_bins[0]
        )
        self.said.text = misfit_words(tried.misfit, reference.misfit)
        self._at(self.k)

    def _causes(self) -> None:
        declared = Draft(self.result.folder / SHOT_FILE).content()
        tried = [
            c
            for c in self.found.causes
            if not c.status and c.explained >= LEAST_EXPLAINED and changed_value(c, declared) is not None
        ]
        frame.heading("Inputs that would explain the data better")
        if not tried:
            frame.note("No single input that was tried explains more of the data.")
            return
        frame.note(
            "A copy of the shot gets the changed input; the shot itself is not changed. Identify the copy, "
            "then compare both."
        )
        for cause in tried:
            with ui.row().classes("w-full items-center gap-3"):
                copy = copy_of(self.result.folder, cause)
                name = frame.beside(self.name, copy)
                if (copy / "results" / RESULT_FILE).is_file():
                    ui.link("Compare", frame.comparison(self.name, name))
                elif copy.is_dir():
                    ui.link("Run the copy", frame.address("run", name))
                else:
                    ui.button("Apply in a copy", on_click=partial(self._apply, cause)).props("outline dense")
                likely = "likely: " if cause.named else ""
                ui.label(
                    f"{likely}{cause.key}: {cause.words}, explains {100.0 * cause.explained:.0f} % of the "
                    "misfit"
                )

    def _apply(self, cause: CauseFinding) -> None:
        """Copy the shot with a changed input, and open the page on which the copy is identified."""
        try:
            copy = copy_with(self.result.folder, cause)
        except InputError as error:
            ui.notify(str(error), type="warning")
            return
        ui.navigate.to(frame.address("run", frame.beside(self.name, copy)))


def answer_words(e: Estimate) -> str:
    """An estimate in words for a page: the line of the terminal with Greek letters."""
    name, _, rest = answer(e).partition(" = ")
    return f"{PARAMETERS[e.name].written if e.name in PARAMETERS else name} = {rest.replace(' us ', ' µs ')}"


def misfit_words(tried: Misfit, reference: Misfit) -> str:
    """Residual of each channel, the same residual in the result, and the change in per cent."""
    pairs = {"force": (tried.force, reference.force), "outline": (tried.outline, reference.outline)}
    return "; ".join(
        f"{name} {now:.2f}, at the answer {then:.2f} ({100.0 * (now / then - 1.0):+.0f} %)"
        for name, (now, then) in pairs.items()
        if np.isfinite(now)
    )
