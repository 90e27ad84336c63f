"""The view for editing a shot file.

It has a form with plots of the files, and the text. Both can be edited.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

from nicegui import events, ui

from dic.images import Pictures
from kolsky.app import frame, signals
from kolsky.app.draft import (
    Conflict,
    Draft,
    FieldEntry,
    by_key,
    choices,
    column_toml,
    fields_of,
    optional_keys,
    series_toml,
)
from kolsky.base.errors import InputError
from kolsky.base.toml import blanks
from kolsky.pictures.picture_set import PictureChanges
from kolsky.schema.shot_file import SHOT_FILE
from kolsky.shot.load import check_shot
from kolsky.shot.summary import remarks, summarise
from kolsky.survey.blank_file import write_new

TITLES = {
    "": "The shot",
    "specimen": "Specimen",
    "interface": "Contact",
    "transmission": "Transmission side",
    "force": "Transmitted force",
    "frames": "Frames of the cameras",
    "flyer": "Flyer",
    "centre_line": "Outline",
    "surface": "Surface by exports",
    "surface.flyer": "Flyer by exports",
    "pictures": "Pictures",
    "calibration": "Calibration",
    "dic": "Image correlation",
    "curve": "Quasi-static curve",
    "law": "Law",
    "model": "Model",
    "window": "Window that is compared",
    "uncertainty": "Uncertainty of the declared inputs",
}
PLOTTED = {"force": signals.force_signal, "frames": signals.motion_signal, "curve": signals.curve_signal}
"""Tables with a plot, and the function that reads the signal of the plot."""
KINDS = {
    "exports": "Exports of a DIC program",
    "pictures": "Pictures of two cameras",
    "bars": "Strain gauges on bars",
}


def page(root: Path) -> None:
    """Register the page."""

    @ui.page("/setup")
    def setup_page(shot: str = "") -> None:
        with frame.framed(f"Set up {shot}", view="setup", shot=shot):
            folder = frame.folder_at(root, shot)
            if (folder / SHOT_FILE).exists():
                SetupView(folder)
            else:
                _begin(folder, shot)


def _begin(folder: Path, shot: str) -> None:
    """The selection of a kind of shot for a folder of raw files."""
    frame.note(
        f"{folder.name} has no shot.toml. It is made from what its files show; what they do not show is left "
        "blank."
    )
    kind = ui.radio(KINDS, value="exports").props('aria-label="Kind of shot"')

    async def make() -> None:
        button.disable()
        try:
            bars, pictures = kind.value == "bars", kind.value == "pictures"
            await frame.in_thread(write_new, folder, bars=bars, pictures=pictures)
        except InputError as error:
            ui.notify(str(error), type="warning")
            button.enable()
            return
        ui.navigate.to(frame.address("setup", shot))

    button = ui.button("Look at the files and write shot.toml", on_click=make)


class SetupView:
    """Form, plots, problems and text of one shot file."""

    def __init__(self, folder: Path) -> None:
        """Build the view.

        Raises InputError if the file cannot be read.
        """
        self.folder, self.draft = folder, Draft(folder / SHOT_FILE)
        self.wrong: dict[str, str] = {}
        self.files = signals.candidate_files(folder)
        self.labels: dict[str, ui.label] = {}
        self.plots: dict[str, ui.echart] = {}
        self.inputs: dict[str, Any] = {}
        self.series: list[Pictures] = []
        self.changes: PictureChanges | None = None
        self.drag = "baseline"
        with ui.row().classes("w-full items-center"):
            self.status = ui.label().props("role=status")
            ui.space()
            ui.button("Undo", on_click=self.undo, icon="undo").props("flat dense")
            ui.button("Read the file again", on_click=self.reload).props("flat dense")
            ui.button("Check", on_click=self.check).props("outline dense")
            ui.button("Run", on_click=lambda: ui.navigate.to(self._address("run"))).props("unelevated dense")
        with ui.element("div").classes("grid2"):
            with ui.column().classes("w-full gap-1"):
                self.form = ui.column().classes("w-full gap-2")
            with ui.column().classes("w-full gap-2 aside"):
                self.found = ui.column().classes("w-full gap-1")
                frame.heading("shot.toml")
                self.text = ui.textarea(value=self.draft.text).props(
                    'outlined aria-label="Text of shot.toml"'
                )
                self.text.classes("w-full text")
                ui.button("Write the text", on_click=self.write_text).props("outline dense")
                frame.note("A change in the form changes only its value here; remarks stay.")
        self.show()

    def _address(self, view: str) -> str:
        root = self.folder
        return frame.address(view, ui.context.client.request.query_params.get("shot", root.name))

    def show(self) -> None:
        """Show form, text and problems of the current file."""
        self.text.value = self.draft.text
        self.form.clear()
        for group in (self.labels, self.plots, self.inputs):
            group.clear()
        with self.form:
            self._form()
        self._report()

    def _form(self) -> None:
        try:
            entries = fields_of(self.draft.text)
        except tomllib.TOMLDecodeError as error:
            frame.note(f"The text is not valid TOML: {error}", "caution")
            return
        tables = list(dict.fromkeys(e.table for e in entries))
        for table in tables:
            mine = [e for e in entries if e.table == table and e.dotted != "format"]
            if mine or optional_keys(self.draft.text, table):
                self._table(table, mine)

    def _table(self, table: str, entries: list[FieldEntry]) -> None:
        open_one = table in PLOTTED or any(e.blank for e in entries)
        title = TITLES.get(table, table)
        with frame.fold(title, opened=open_one).props('header-class="text-weight-medium"'):
            if table in PLOTTED:
                self._plot(table)
            for e in entries:
                self._field(e)
            off = optional_keys(self.draft.text, table)
            if off:
                self._optional(table, off)

    def _field(self, e: FieldEntry) -> None:
        with ui.element("div").classes("key"):
            value = e.parsed
            listed = choices(e.dotted)
            words = e.key.replace("_", " ")
            if e.dotted == "calibration.file":
                self._listed(e, signals.rig_files(self.folder), words)
            elif e.table == "calibration" and e.key.startswith("camera_"):
                patterns = [s.name for s in signals.picture_series(self.folder) if s.key == "pattern"]
                self._listed(e, patterns, words)
            elif e.table == "pictures" and isinstance(value, dict):
                self._pictures(e, value, words)
            elif e.key == "file" and e.table:
                self._file(e, words)
            elif e.key == "frame" and isinstance(value, str):
                self._listed(e, self._units(e.table), words)
            elif isinstance(value, dict) and set(value) == {"column", "unit"}:
                self._column(e, value)
            elif listed:
                self._listed(e, listed, words)
            elif isinstance(value, list) and len(value) <= 3 and all(isinstance(v, str) for v in value):
                self._list(e, value, words)
            else:
                field = ui.input(words, value=e.display)
                frame.on_entry(field, partial(self._typed, e, field))
                self._keep(e, field)
            if e.remark:
                ui.label(e.remark).classes("remark")
            self.labels[e.dotted] = ui.label().classes("wrong").mark(f"problem-{e.dotted}")

    def _keep(self, e: FieldEntry, element: Any) -> None:
        element.classes("w-full").props(f"dense outlined data-key={e.dotted}").mark(e.dotted)
        self.inputs[e.dotted] = element

    def _listed(
        self, e: FieldEntry, listed: Iterable[str], words: str, act: Callable[..., None] | None = None
    ) -> None:
        """A key with a list of values. A value that is not in the list is kept."""
        options = list(dict.fromkeys([*listed, *([e.display] if e.display else [])]))
        change = partial(act or self._chosen, e)
        self._keep(e, ui.select(options, value=e.display or None, label=words, on_change=change))

    def _pictures(self, e: FieldEntry, value: dict[str, Any], words: str) -> None:
        """The picture series of a camera, selected from those of the folder, and its offset on the sensor."""
        known = {one.name: one for one in signals.picture_series(self.folder)}
        name = str(value.get("file") or value.get("pattern") or "")
        crop = value.get("crop_offset", ["", ""])
        options = {
            **{n: one.said for n, one in known.items()},
            **({} if name in known or not name else {name: name}),
        }
        with ui.row().classes("w-full no-wrap gap-2"):
            series = frame.choice(options, name or None, words, width="grow min-w-0")
            series.props(f"data-key={e.dotted}").mark(e.dotted)
            offsets = []
            for i, axis in enumerate("xy"):
                field = ui.input(f"crop {axis}", value=str(crop[i])).classes("w-20")
                field.props(f"dense outlined data-key={e.dotted}.{axis}").mark(f"{e.dotted}.{axis}")
                offsets.append(field)

        def chosen(_: object = None) -> None:
            picked = str(series.value or "")
            one = known.get(picked)
            if one is not None and one.crop is not None and not any(field.value for field in offsets):
                for field, place in zip(offsets, one.crop, strict=True):
                    field.value = f"{place:g}"
            key = one.key if one is not None else "pattern" if "*" in picked else "file"
            toml = series_toml(key, picked, [str(field.value or "") for field in offsets])
            self._set({e.dotted: toml}, rebuild=picked != name)

        series.on_value_change(chosen)
        for field in offsets:
            frame.on_entry(field, chosen)

    def _file(self, e: FieldEntry, words: str) -> None:
        self._listed(e, self.files, words, self._assign)
        if e.display:
            fold = ui.expansion("Columns").props('dense aria-label="Columns of the file"')
            fold.on_value_change(partial(self._preview, e, fold))

    def _preview(self, e: FieldEntry, fold: ui.expansion, change: events.ValueChangeEventArguments) -> None:
        if not change.value:
            return
        fold.clear()
        with fold:
            try:
                heads, rows = signals.preview(signals.entry(self.folder, e.display))
            except InputError as error:
                frame.note(str(error), "caution")
                return
            columns = [{"name": str(i), "label": h, "field": str(i)} for i, h in enumerate(heads)]
            table = [{str(i): cell for i, cell in enumerate(row)} | {"row": k} for k, row in enumerate(rows)]
            ui.table(rows=table, columns=columns, row_key="row").props("flat dense hide-pagination").classes(
                "w-full"
            )

    def _assign(self, e: FieldEntry, change: events.ValueChangeEventArguments) -> None:
        """Assign a file to a table, with its columns."""
        name = str(change.value or "")
        if name == e.display:
            return
        values: dict[str, str] = {e.dotted: f'"{name}"'}
        try:
            found = signals.assigned(e.table, signals.entry(self.folder, name))
            values |= {key: value for key, value in found.items() if value is not None}
            values[e.dotted] = f'"{name}"'  # also in a separate folder
        except InputError as error:
            ui.notify(str(error), type="warning")
        self._set(values, rebuild=True)

    def _units(self, table: str) -> dict[str, str]:
        """The columns of a table's file with their units. Empty while no file is selected."""
        section = self.draft.content().get(table, {})
        with suppress(InputError):  # the file's field shows the reason
            return {c.name: c.unit for c in signals.entry(self.folder, str(section.get("file", ""))).columns}
        return {}

    def _column(self, e: FieldEntry, value: dict[str, Any]) -> None:
        units = self._units(e.table)
        name, unit = str(value["column"]), str(value["unit"])
        options = list(dict.fromkeys([*units, *([name] if name else [])]))
        words = e.key.replace("_", " ")
        with ui.row().classes("w-full no-wrap gap-2"):
            column = frame.choice(options, name or None, f"{words}: column", width="grow")
            given = ui.input("unit", value=unit).classes("w-24")
        column.mark(f"{e.dotted}.column")
        given.props(f'dense outlined aria-label="{words}: unit"').mark(f"{e.dotted}.unit")

        def chosen(_: object = None) -> None:
            picked = str(column.value or "")
            if picked != name and not given.value:
                given.value = units.get(picked, "")
            toml = column_toml(picked, str(given.value or ""))
            self._set({e.dotted: toml})

        column.on_value_change(chosen)
        frame.on_entry(given, chosen)

    def _list(self, e: FieldEntry, value: list[str], words: str) -> None:
        element: list[ui.input] = []

        def typed(_: object = None) -> None:
            toml = "[" + ", ".join(f'"{str(one.value or "").strip()}"' for one in element) + "]"
            self._set({e.dotted: toml})

        with ui.row().classes("w-full no-wrap gap-2"):
            for i, one in enumerate(value):
                field = ui.input(f"{words} {i + 1}", value=one).classes("grow")
                field.props(f"dense outlined data-key={e.dotted}.{i}")
                field.mark(f"{e.dotted}.{i}")
                frame.on_entry(field, typed)
                element.append(field)
                self.inputs[f"{e.dotted}.{i}"] = field

    def _optional(self, table: str, keys: list[str]) -> None:
        with ui.row().classes("items-center gap-2"):
            chosen = frame.choice(keys, None, "Optional key", width="w-44").props("options-dense")
            value = ui.input("its value").props("dense outlined")

            def add() -> None:
                if chosen.value and value.value:
                    key = f"{table}.{chosen.value}".removeprefix(".")
                    typed = str(value.value)
                    self._change(lambda: self.draft.enter(key, typed), rebuild=True)

            ui.button("Add", on_click=add).props("flat dense")

    def _typed(self, e: FieldEntry, element: ui.input, _: object = None) -> None:
        self._change(lambda: self.draft.enter(e.dotted, str(element.value or "")))

    def _chosen(self, e: FieldEntry, change: events.ValueChangeEventArguments) -> None:
        self._change(lambda: self.draft.enter(e.dotted, str(change.value or "")))

    def _set(self, values: dict[str, str], *, rebuild: bool = False) -> None:
        """Write values as TOML by their keys."""
        self._change(lambda: self.draft.set_values(values), rebuild=rebuild)

    def _change(self, act: Callable[[], object], *, rebuild: bool = False) -> None:
        """Change the file, and report a change that could not be written."""
        before = self.draft.text
        try:
            act()
        except InputError as error:
            self._say(f"Not written. {error}", "caution")
            if isinstance(error, Conflict):
                ui.notify(str(error), type="negative")
            return
        if self.draft.text == before:
            return
        self.text.value = self.draft.text
        entries = fields_of(self.draft.text)
        if rebuild or [e.dotted for e in entries] != [e.dotted for e in fields_of(before)]:
            self.show()
        else:
            self._show_values(entries)
            self._report()
            for table, plot in self.plots.items():
                self._fill(table, plot)

    def _say(self, words: str, kind: str = "soft") -> None:
        """Show the state of the file."""
        self.status.text = words
        self.status.classes(replace=kind)

    def _report(self) -> None:
        """Show what is missing or wrong, at its field and above the text."""
        try:
            self.wrong = by_key(self.draft.problems())
            content = tomllib.loads(self.draft.text)
        except (InputError, tomllib.TOMLDecodeError) as error:
            self.wrong, content = {"": str(error)}, {}
        empty = list(blanks(content))
        self._label()
        wrong = f"{len(self.wrong)} values cannot be used yet" if self.wrong else ""
        state = f"{len(empty)} values are not filled in" if empty else wrong
        self._say(state or "Every value is filled in. Check reads the files.")
        self.found.clear()
        with self.found:
            shown = {key: words for key, words in self.wrong.items() if key not in self.labels}
            for key, words in shown.items():
                if not any(key.startswith(f"{one}.") for one in self.labels):
                    frame.note(f"{key}: {words}".removeprefix(": "), "caution")

    def _show_values(self, entries: Iterable[FieldEntry]) -> None:
        """Update the fields with values that changed at another place, for example by dragging."""
        for e in entries:
            value = e.parsed
            parts = {f"{e.dotted}.{i}": v for i, v in enumerate(value)} if isinstance(value, list) else {}
            for key, shown in {e.dotted: e.display or None, **parts}.items():
                if key in self.inputs and (self.inputs[key].value or None) != shown:
                    self.inputs[key].value = shown or ""

    def _label(self) -> None:
        """Show each problem at the field of its key or of the parent key."""
        for key, label in self.labels.items():
            parts = [words for one, words in self.wrong.items() if one == key or one.startswith(f"{key}.")]
            label.text = "; ".join(parts)

    def undo(self) -> None:
        """Undo the last change of this page."""
        if not self.draft.undone:
            ui.notify("There is nothing to undo on this page.")
            return
        self._change(self.draft.undo, rebuild=True)

    def reload(self) -> None:
        """Read the file from disk again."""
        try:
            self.draft.reload()
        except InputError as error:
            ui.notify(str(error), type="negative")
            return
        self.show()

    def write_text(self) -> None:
        """Write the text of the text editor to the file."""
        text = str(self.text.value)
        self._change(lambda: self.draft.write(text), rebuild=True)

    async def check(self) -> None:
        """Read the shot with its files, and show the errors or a summary."""
        self._say("The files are read ...")
        try:
            loaded = await frame.in_thread(check_shot, self.folder)
        except InputError as error:
            self.wrong = by_key(error.problems)
            self._label()
            count = len(error.problems)
            self._say(f"The check found {count} problem{'' if count == 1 else 's'}", "caution")
            self.found.clear()
            with self.found:
                for one in error.problems:
                    frame.note(str(one), "caution")
            return
        self._say("The check passed")
        self.found.clear()
        with self.found:
            for words in remarks(loaded):
                frame.note(words, "caution")
            with frame.fold("What was read"):
                for line in summarise(loaded):
                    frame.note(f"{line.section} {line.name}: {line.written()}")

    def _plot(self, table: str) -> None:
        """The plot of a table, with its draggable spans."""
        words = {
            "force": "The force's signal",
            "frames": "Motion of the flyer",
            "curve": "Quasi-static curve",
        }[table]
        plot = frame.chart("", "", [], words=words, legend=False).mark(f"plot-{table}")
        self.plots[table] = plot
        if table == "force":
            plot.options["toolbox"] = {"show": False}
            plot.options["brush"] = {
                "xAxisIndex": 0,
                "brushStyle": {"color": "rgba(0,114,178,.15)", "borderColor": frame.BLUE},
            }
            plot.on("chart:brushEnd", self._dragged, args=["areas"])
            with ui.row().classes("items-center gap-2"):
                ui.label("Drag over the signal to set the").classes("soft")
                ui.toggle(
                    {"baseline": "baseline", "window": "window"},
                    value=self.drag,
                    on_change=lambda change: setattr(self, "drag", change.value),
                ).props("dense no-caps")
        elif table == "frames":
            self._static_slider(plot)
        self._fill(table, plot)

    def _static_slider(self, plot: ui.echart) -> None:
        """The slider of the frames at rest, beside the pictures or below the motion."""
        content = self.draft.content()
        number = content.get("frames", {}).get("static", 0)
        first = int(number) if isinstance(number, int) else 0
        self.series = signals.declared_series(self.folder, content)
        try:
            signal = None if self.series else signals.motion_signal(self.folder, content)
        except InputError:
            signal = None
        count = min((one.n_frames for one in self.series), default=len(signal.x) if signal else 0)
        if not count:
            return
        with ui.row().classes("w-full items-center no-wrap gap-3"):
            ui.label("Frames at rest").classes("soft whitespace-nowrap")
            slider = ui.slider(min=0, max=count, value=first).props('label aria-label="Frames at rest"')
            slider.on("change", lambda: self._set({"frames.static": str(int(slider.value))}))
            slider.mark("static-slider")
        if self.series:
            self._pictures_at_rest(slider)
            ui.timer(0.05, partial(self._compare_pictures, plot), once=True)

    def _pictures_at_rest(self, slider: ui.slider) -> None:
        """The pictures of both cameras in the last frame at rest, given by the slider."""
        now = ui.label().classes("soft").mark("frame-at-rest")
        with ui.row().classes("w-full no-wrap gap-2"):
            images = [ui.image().classes("w-1/2").props(f'alt="Camera {i}"') for i in range(len(self.series))]

        def show(_: object = None) -> None:
            k = max(int(slider.value) - 1, 0)
            now.text = f"Frame {k}, the last one at rest" if slider.value else "No frame is at rest"
            for image, pictures in zip(images, self.series, strict=True):
                image.set_source(frame.source_of(pictures, k))

        slider.on_value_change(show)
        show()

    async def _compare_pictures(self, plot: ui.echart) -> None:
        """Read the pictures, then plot their change over time."""
        self.changes = await frame.in_thread(signals.changes, self.series)
        self._fill("frames", plot)
        if "force" in self.plots:
            self._fill("force", self.plots["force"])

    def _signal(self, table: str, content: dict[str, Any]) -> signals.Signal | None:
        """The signal in the plot of a table. None while a file or column is not declared."""
        try:
            if table == "frames" and self.series:
                return None if self.changes is None else signals.change_signal(self.changes)
            return PLOTTED[table](self.folder, content)
        except (InputError, ValueError, OSError):
            return None  # the field of its file shows the reason

    def _motion(self, content: dict[str, Any]) -> signals.Signal | None:
        """The flyer's motion on the shot's clock, for the plot of the force."""
        motion = self._signal("frames", content)
        try:
            return None if motion is None else signals.on_clock(self.folder, content, motion)
        except (InputError, ValueError, OSError):
            return None

    def _fill(self, table: str, plot: ui.echart) -> None:
        """Draw a plot with the current declarations of the file."""
        content = self.draft.content()
        signal = self._signal(table, content)
        plot.set_visibility(signal is not None)
        if signal is None:
            return
        plot.options["xAxis"] = one_sided(signal.x_name, nameGap=28)
        plot.options["yAxis"] = one_sided(signal.y_name, nameGap=46)
        data = frame.line("signal", frame.points(signal.x, signal.y), frame.INK)
        data["lineStyle"]["width"] = 1.0
        lines = [data]
        if table == "force":
            self._mark_spans(data, content)
            lines += self._add_motion(plot, content)
        if table == "frames" and isinstance(static := content.get("frames", {}).get("static"), int):
            mark = {"xAxis": static - 1, "name": "last frame at rest"}
            data["markLine"] = {
                "silent": True, "symbol": "none", "data": [mark], "lineStyle": {"color": frame.BLUE},
                "label": {"formatter": "last frame at rest", "color": frame.INK},
            }  # fmt: skip
        plot.options["series"] = lines  # the options copy what they are given
        plot.update()
        if table == "force":
            with plot:
                ui.timer(0.4, partial(_brush_on, plot), once=True)  # new options end the choice by drags

    def _mark_spans(self, data: dict[str, Any], content: dict[str, Any]) -> None:
        """Mark baseline and window on the force."""
        areas = []
        for name, colour, span in (
            ("baseline", "rgba(0,114,178,.16)", signals.interval_of(content, "force", "baseline")),
            ("window", "rgba(213,94,0,.10)", signals.interval_of(content, "window", "start", "end")),
        ):
            if span is not None:
                areas.append(
                    [{"name": name, "xAxis": span[0], "itemStyle": {"color": colour}}, {"xAxis": span[1]}]
                )
        data["markArea"] = {
            "silent": True,
            "label": {"color": frame.INK, "position": "insideTop"},
            "data": areas,
        }

    def _add_motion(self, plot: ui.echart, content: dict[str, Any]) -> list[dict[str, Any]]:
        """Add the flyer's motion to the plot of the force: both begin together if the clocks are correct."""
        motion = self._motion(content)
        plot.options["legend"]["show"] = motion is not None
        plot.options["grid"] |= {"top": 34 if motion else 14, "right": 62 if motion else 18}
        if motion is None:
            return []
        blank = "" if content.get("frames", {}).get("clock_offset") else " (its clock offset is blank)"
        line = frame.line(f"flyer{blank}", frame.points(motion.x, motion.y), frame.BLUE, yAxisIndex=1)
        right = one_sided(motion.y_name, nameGap=40, position="right")
        plot.options["yAxis"] = [plot.options["yAxis"], right]
        return [line]

    def _dragged(self, event: events.GenericEventArguments) -> None:
        """Use a dragged time span as the baseline or the window."""
        areas = event.args.get("areas") if isinstance(event.args, dict) else event.args[0]
        if not areas:
            return
        first, last = sorted(float(v) for v in areas[0]["coordRange"])
        data = self.plots["force"].options["series"][0]["data"]
        first, last = max(first, data[0][0]), min(last, data[-1][0])  # beyond the record means its end
        ends = [f'"{math.ceil(10.0 * first) / 10.0:.8g} us"', f'"{math.floor(10.0 * last) / 10.0:.8g} us"']
        values = {"force.baseline": f"[{ends[0]}, {ends[1]}]"}
        if self.drag == "window":
            values = {"window.start": ends[0], "window.end": ends[1]}
        self._set(values)


def one_sided(name: str, **more: Any) -> dict[str, Any]:
    """An axis at the edge of its plot instead of at zero."""
    made = frame.axis(name, **more)
    made["axisLine"]["onZero"] = False
    return made


def _brush_on(plot: ui.echart) -> None:
    """Let the user drag a time span on a plot. The previous span is removed."""
    plot.run_chart_method("dispatchAction", {"type": "brush", "areas": []})
    plot.run_chart_method(
        "dispatchAction",
        {
            "type": "takeGlobalCursor",
            "key": "brush",
            "brushOption": {"brushType": "lineX", "brushMode": "single"},
        },
    )
