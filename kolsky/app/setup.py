"""The view in which a shot file is made: a form beside plots of the files, and its text, edited both ways."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

from nicegui import events, run, ui

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
)
from kolsky.base.errors import InputError
from kolsky.base.toml import blanks
from kolsky.schema.shot_file import SHOT_FILE
from kolsky.shot.load import check_shot
from kolsky.shot.summary import remarks, summarise
from kolsky.survey.blank_file import new_text
from kolsky.survey.pictures import survey_pictures
from kolsky.survey.tables import survey

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
    "uncertainty": "Uncertainty of what is declared",
}
PLOTTED = {"force": signals.force_signal, "frames": signals.motion_signal, "curve": signals.curve_signal}
"""Tables with a plot, and what it shows."""
KINDS = {
    "exports": "Exports of a DIC program",
    "pictures": "Pictures of two cameras",
    "bars": "Strain gauges on bars",
}


def new_shot(folder: Path, kind: str) -> None:
    """Write the shot file of a folder without one, as `kolsky new` does.

    ``kind``: one of `KINDS`. Raises InputError if there is one.
    """
    found = survey(folder)
    pictures = survey_pictures(folder, found) if kind == "pictures" else None
    text = new_text(found, folder, bars=kind == "bars", pictures=pictures)
    try:
        with (folder / SHOT_FILE).open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        raise InputError(
            folder / SHOT_FILE, "exists already and was not changed", cure="open it again"
        ) from None


def page(root: Path) -> None:
    """Register the page."""

    @ui.page("/setup")
    def setup_page(shot: str = "") -> None:
        with frame.framed(f"Set up {shot}", view="setup", shot=shot):
            try:
                folder = frame.folder_at(root, shot)
            except frame.NoShot as error:
                frame.note(str(error), "caution")
                return
            if (folder / SHOT_FILE).exists():
                try:
                    SetupView(folder)
                except InputError as error:
                    frame.note(str(error), "caution")
            else:
                _begin(folder, shot)


def _begin(folder: Path, shot: str) -> None:
    """The choice of a kind of shot for a folder of raw files."""
    frame.note(
        f"{folder.name} has no shot.toml. It is made from what its files show; what they do not show is left "
        "blank."
    )
    kind = ui.radio(KINDS, value="exports").props('aria-label="Kind of shot"')

    async def make() -> None:
        button.disable()
        try:
            await run.io_bound(new_shot, folder, str(kind.value))
        except InputError as error:
            ui.notify(str(error), type="warning")
            button.enable()
            return
        ui.navigate.to(frame.address("setup", shot))

    button = ui.button("Look at the files and write shot.toml", on_click=make)


class SetupView:
    """Form, plots, problems and text of one shot file."""

    def __init__(self, folder: Path) -> None:
        """Build the view. Raises InputError if the file cannot be read."""
        self.folder, self.draft = folder, Draft(folder / SHOT_FILE)
        self.wrong: dict[str, str] = {}
        self.files = signals.candidate_files(folder)
        self.labels: dict[str, ui.label] = {}
        self.inputs: dict[str, Any] = {}
        self.plots: dict[str, ui.echart] = {}
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
        """Show form, text and problems as the file is now."""
        self.text.value = self.draft.text
        self.form.clear()
        for group in (self.labels, self.inputs, self.plots):
            group.clear()
        with self.form:
            self._form()
        self._report()

    def _form(self) -> None:
        try:
            entries = fields_of(self.draft.text)
        except tomllib.TOMLDecodeError as error:
            frame.note(f"The text is no valid TOML: {error}", "caution")
            return
        tables = list(dict.fromkeys(e.table for e in entries))
        for table in tables:
            mine = [e for e in entries if e.table == table and e.dotted != "format"]
            if mine or optional_keys(self.draft.text, table):
                self._table(table, mine)

    def _table(self, table: str, entries: list[FieldEntry]) -> None:
        open_one = table in PLOTTED or any(e.blank for e in entries)
        title = TITLES.get(table, table)
        with (
            ui.expansion(title, value=open_one)
            .classes("w-full")
            .props(f'dense header-class="text-weight-medium" aria-label="{title}"')
        ):
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
            if e.key == "file" and e.table:
                self._file(e, words)
            elif isinstance(value, dict) and set(value) == {"column", "unit"}:
                self._column(e, value)
            elif listed:
                options = list(dict.fromkeys([*listed, *([e.display] if e.display else [])]))
                element = ui.select(
                    options, value=e.display or None, label=words, on_change=partial(self._chosen, e)
                )
                self._keep(e, element)
            elif isinstance(value, list) and len(value) <= 3 and all(isinstance(v, str) for v in value):
                self._list(e, value, words)
            else:
                element = ui.input(words, value=e.display)
                for event in ("blur", "keydown.enter"):
                    element.on(event, partial(self._typed, e, element))
                self._keep(e, element)
            if e.remark:
                ui.label(e.remark).classes("remark")
            self.labels[e.dotted] = ui.label().classes("wrong")

    def _keep(self, e: FieldEntry, element: Any) -> None:
        self.inputs[e.dotted] = element
        element.classes("w-full").props(f"dense outlined data-key={e.dotted}").mark(e.dotted)

    def _file(self, e: FieldEntry, words: str) -> None:
        options = list(dict.fromkeys([*self.files, *([e.display] if e.display else [])]))
        element = ui.select(options, value=e.display or None, label=words, on_change=partial(self._assign, e))
        self._keep(e, element)
        if e.display:
            with ui.expansion("Columns").props('dense aria-label="Columns of the file"') as fold:
                pass
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
        """Take a file for a table, with the layout and columns that it shows."""
        name = str(change.value or "")
        if name == e.display:
            return
        values: dict[str, str] = {e.dotted: f'"{name}"'}
        try:
            found = signals.assigned(e.table, signals.entry(self.folder, name))
            values |= {key: value for key, value in found.items() if value is not None}
            values[e.dotted] = f'"{name}"'  # also in a folder of its own
        except InputError as error:
            ui.notify(str(error), type="warning")
        self._change(lambda: self.draft.set_values(values), rebuild=True)

    def _column(self, e: FieldEntry, value: dict[str, Any]) -> None:
        section = self.draft.content().get(e.table, {})
        units: dict[str, str] = {}
        with suppress(InputError):  # its file is not chosen yet; the file's own field says so
            units = {c.name: c.unit for c in signals.entry(self.folder, str(section.get("file", ""))).columns}
        name, unit = str(value["column"]), str(value["unit"])
        options = list(dict.fromkeys([*units, *([name] if name else [])]))
        words = e.key.replace("_", " ")
        with ui.row().classes("w-full no-wrap gap-2"):
            column = (
                ui.select(options, value=name or None, label=f"{words}: column")
                .classes("grow")
                .props("dense outlined")
            )
            given = (
                ui.input("unit", value=unit)
                .classes("w-24")
                .props(f'dense outlined aria-label="{words}: unit"')
            )
        column.mark(f"{e.dotted}.column")
        given.mark(f"{e.dotted}.unit")

        def chosen(_: object = None) -> None:
            picked = str(column.value or "")
            if picked != name and not given.value:
                given.value = units.get(picked, "")
            toml = column_toml(picked, str(given.value or ""))
            self._change(lambda: self.draft.set_values({e.dotted: toml}))

        column.on_value_change(chosen)
        for event in ("blur", "keydown.enter"):
            given.on(event, chosen)

    def _list(self, e: FieldEntry, value: list[str], words: str) -> None:
        element: list[ui.input] = []

        def typed(_: object = None) -> None:
            toml = "[" + ", ".join(f'"{str(one.value or "").strip()}"' for one in element) + "]"
            self._change(lambda: self.draft.set_values({e.dotted: toml}))

        with ui.row().classes("w-full no-wrap gap-2"):
            for i, one in enumerate(value):
                field = ui.input(f"{words} {i + 1}", value=one).classes("grow")
                field.props(f"dense outlined data-key={e.dotted}.{i}")
                field.mark(f"{e.dotted}.{i}")
                for event in ("blur", "keydown.enter"):
                    field.on(event, typed)
                element.append(field)
        self.inputs[e.dotted] = element

    def _optional(self, table: str, keys: list[str]) -> None:
        with ui.row().classes("items-center gap-2"):
            chosen = (
                ui.select(keys, label="Optional key").classes("w-44").props("dense outlined options-dense")
            )
            value = ui.input("its value").props("dense outlined")

            def add() -> None:
                if chosen.value and value.value:
                    key = f"{table}.{chosen.value}".removeprefix(".")
                    typed = str(value.value)
                    self._change(lambda: self.draft.enter(key, typed), rebuild=True)

            ui.button("Add", on_click=add).props("flat dense")

    def _typed(self, e: FieldEntry, element: ui.input, _: object = None) -> None:
        typed = str(element.value or "")
        self._change(lambda: self.draft.enter(e.dotted, typed))

    def _chosen(self, e: FieldEntry, change: events.ValueChangeEventArguments) -> None:
        typed = str(change.value or "")
        self._change(lambda: self.draft.enter(e.dotted, typed))

    def _change(self, act: Callable[[], object], *, rebuild: bool = False) -> None:
        """Change the file; what is not written is said."""
        before = self.draft.text
        try:
            act()
        except Conflict as error:
            self.status.text = f"Not written. {error}"
            self.status.classes(replace="caution")
            ui.notify(str(error), type="negative")
            return
        except InputError as error:
            self.status.text = f"Not written. {error}"
            self.status.classes(replace="caution")
            return
        if self.draft.text == before:
            return
        self.text.value = self.draft.text
        if rebuild:
            self.show()
        else:
            self._report()
            for table, plot in self.plots.items():
                self._fill(table, plot)

    def _report(self) -> None:
        """Say what is missing or wrong, at its field and above the text."""
        try:
            self.wrong = by_key(self.draft.problems())
            content = tomllib.loads(self.draft.text)
        except (InputError, tomllib.TOMLDecodeError) as error:
            self.wrong, content = {"": str(error)}, {}
        empty = list(blanks(content))
        for key, label in self.labels.items():
            parts = [words for one, words in self.wrong.items() if one == key or one.startswith(f"{key}.")]
            label.text = "; ".join(parts)
        self.status.classes(replace="soft")
        if empty:
            self.status.text = f"{len(empty)} values are not filled in"
        elif self.wrong:
            self.status.text = f"{len(self.wrong)} values cannot be used yet"
        else:
            self.status.text = "Every value is filled in. Check reads the files."
        self.found.clear()
        with self.found:
            shown = {key: words for key, words in self.wrong.items() if key not in self.labels}
            for key, words in shown.items():
                if not any(key.startswith(f"{one}.") for one in self.labels):
                    frame.note(f"{key}: {words}".removeprefix(": "), "caution")

    def undo(self) -> None:
        """Take the last change of this page back."""
        if not self.draft.undone:
            ui.notify("There is nothing to take back on this page.")
            return
        self._change(self.draft.undo, rebuild=True)

    def reload(self) -> None:
        """Take the file as it is on the disk."""
        try:
            self.draft.reload()
        except InputError as error:
            ui.notify(str(error), type="negative")
            return
        self.show()

    def write_text(self) -> None:
        """Write the text as it stands beside the form."""
        text = str(self.text.value)
        self._change(lambda: self.draft.write(text), rebuild=True)

    async def check(self) -> None:
        """Read the shot with its files, and say what is wrong or what was read."""
        self.status.text = "The files are read ..."
        try:
            loaded = await run.io_bound(check_shot, self.folder)
        except InputError as error:
            self.wrong = by_key(error.problems)
            for key, label in self.labels.items():
                label.text = self.wrong.get(key, "")
            self.status.text = f"The check found {len(error.problems)} problems"
            self.status.classes(replace="caution")
            self.found.clear()
            with self.found:
                for one in error.problems:
                    frame.note(str(one), "caution")
            return
        self.status.text = "The check passed"
        self.status.classes(replace="soft")
        self.found.clear()
        with self.found:
            for words in remarks(loaded):
                frame.note(words, "caution")
            with (
                ui.expansion("What was read", value=False)
                .classes("w-full")
                .props('dense aria-label="What was read"')
            ):
                for one in summarise(loaded):
                    frame.note(f"{one.section} {one.name}: {one.written()}")

    def _plot(self, table: str) -> None:
        """The plot of a table, with what is dragged on it."""
        words = {
            "force": "The force's signal",
            "frames": "Motion of the flyer",
            "curve": "Quasi-static curve",
        }[table]
        plot = frame.chart("", "", [], words=words, legend=False)
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
            ui.timer(0.4, partial(_brush_on, plot), once=True)
        elif table == "frames":
            self._static_slider(plot)
        self._fill(table, plot)

    def _static_slider(self, plot: ui.echart) -> None:
        content = self.draft.content()
        number = content.get("frames", {}).get("static", 0)
        try:
            signal = signals.motion_signal(self.folder, content)
        except InputError:
            signal = None
        if signal is None:
            return
        first = int(number) if isinstance(number, int) else 0
        with ui.row().classes("w-full items-center no-wrap gap-3"):
            ui.label("Frames at rest").classes("soft")
            slider = ui.slider(min=0, max=len(signal.x), value=first).props(
                'label aria-label="Frames at rest"'
            )
            slider.on(
                "change",
                lambda: self._change(
                    lambda: self.draft.set_values({"frames.static": str(int(slider.value))})
                ),
            )
            slider.mark("static-slider")

    def _fill(self, table: str, plot: ui.echart) -> None:
        """Draw a plot as the file declares it now."""
        content = self.draft.content()
        try:
            signal = PLOTTED[table](self.folder, content)
        except (InputError, ValueError, OSError):
            signal = None  # the field of its file says why
        plot.set_visibility(signal is not None)
        if signal is None:
            return
        plot.options["xAxis"] = frame.axis(signal.x_name, nameGap=28)
        plot.options["yAxis"] = frame.axis(signal.y_name, nameGap=46)
        data = frame.line("signal", frame.points(signal.x, signal.y), frame.INK)
        data["lineStyle"]["width"] = 1.0
        areas = []
        if table == "force":
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
        if table == "frames" and isinstance(static := content.get("frames", {}).get("static"), int):
            mark = {"xAxis": static - 1, "name": "last frame at rest"}
            data["markLine"] = {
                "silent": True, "symbol": "none", "data": [mark], "lineStyle": {"color": frame.BLUE},
                "label": {"formatter": "last frame at rest", "color": frame.INK},
            }  # fmt: skip
        plot.options["series"] = [data]
        plot.update()

    def _dragged(self, event: events.GenericEventArguments) -> None:
        """Take a dragged stretch of time for the baseline or the window."""
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
        self._change(lambda: self.draft.set_values(values), rebuild=True)


def _brush_on(plot: ui.echart) -> None:
    """Let a drag on a plot choose a stretch of time."""
    plot.run_chart_method(
        "dispatchAction",
        {
            "type": "takeGlobalCursor",
            "key": "brush",
            "brushOption": {"brushType": "lineX", "brushMode": "single"},
        },
    )
