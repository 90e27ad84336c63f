"""The calibration page: every pair of pictures of the target, with detected points and residuals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from nicegui import ui

from dic.calibration.views import Calibration, Pair, PairView
from dic.images import Pictures
from kolsky.app import frame
from kolsky.base.errors import InputError
from kolsky.base.process import single_threaded_libraries
from kolsky.pictures.calibration import calibration_of, calibration_pictures, read_calibration_toml
from kolsky.report.pages.surfaces import calibration_summary, calibration_warnings

ARROW = 0.02
"""Length of the arrow of an rms residual, relative to the width of a picture [-]."""


def solve(folder: Path, progress: dict[str, tuple[int, int]]) -> tuple[Calibration, list[Pictures]]:
    """Calibrate in the way of `kolsky calibrate`. Returns the calibration and its pictures.

    `progress` gets the number of pictures done, and of all. Raises InputError as `calibration_of`.
    """
    toml, section = read_calibration_toml(folder)
    with single_threaded_libraries():
        found = calibration_of(toml, section, lambda _, done, total: progress.update(now=(done, total)))
    return found, calibration_pictures(toml, section)


class CalibrationView:
    """Pairs of pictures with detected points, the table of pairs, and the numbers of the calibration."""

    def __init__(self, folder: Path) -> None:
        """Build the view. The target is detected when the user requests it."""
        self.folder = folder
        self.progress: dict[str, tuple[int, int]] = {}
        self.place = ui.column().classes("w-full gap-2")
        with self.place:
            frame.note("Finds the target in every picture and solves the cameras, as `kolsky calibrate`.")
            self.button = ui.button("Calibrate", on_click=self._solve).props("unelevated dense")
            self.state = ui.label().props("role=status").classes("soft")
        self.timer = ui.timer(0.5, self._advance, active=False)

    def _advance(self) -> None:
        done, total = self.progress.get("now", (0, 0))
        self.state.text = f"{done} of {total} pictures" if total else "The pictures are opened ..."

    async def _solve(self) -> None:
        self.button.disable()
        self.timer.active = True
        try:
            self.found, self.series = await frame.in_thread(solve, self.folder, self.progress)
        except InputError as error:
            self.state.text = str(error)
            self.state.classes(replace="caution")
            self.button.enable()
            return
        finally:
            self.timer.active = False
        self.place.clear()
        with self.place:
            self._show()

    def _show(self) -> None:
        found = self.found
        for words in calibration_warnings(found):
            frame.note(words, "caution")
        with ui.row().classes("w-full items-center no-wrap gap-3"):
            ui.label("Pair").classes("soft whitespace-nowrap")
            self.slider = ui.slider(min=0, max=max(len(found.pairs) - 1, 1), value=0)
            self.slider.props('aria-label="Pair"').mark("pair")
            self.slider.on_value_change(lambda change: self._at(min(int(change.value), len(found.pairs) - 1)))
        self.about = ui.label().props("role=status").mark("pair-words")
        with ui.element("div").classes("grid2"):
            self.images = [frame.camera(i, "Target in") for i in range(2)]
        length = arrow_scale(found, self.series[0].shape[1])
        frame.note(
            f"Circles: detected points. Arrows: measured minus expected place, {length:.0f} times "
            "enlarged. Red: points too far off, left out."
        )
        with ui.element("div").classes("grid2"):
            with ui.column().classes("w-full gap-1"):
                self._pairs()
            with ui.column().classes("w-full gap-1"):
                frame.heading("Cameras")
                rows = [{"name": name, "value": value} for name, value in calibration_summary(found).items()]
                columns = [
                    {"name": key, "label": words, "field": key, "align": "left"}
                    for key, words in (("name", "Quantity"), ("value", "Value"))
                ]
                ui.table(rows=rows, columns=columns, row_key="name").props(
                    "flat dense wrap-cells hide-pagination"
                ).classes("w-full")
        self._at(0)

    def _pairs(self) -> None:
        frame.heading("Rms residual of every pair")
        pairs = self.found.pairs
        series = []
        for i, colour in enumerate((frame.INK, frame.BLUE)):
            rms = [np.nan if (view := pair.views[i]) is None else view.rms for pair in pairs]
            series.append(frame.dots(f"camera {i}", frame.points(range(len(pairs)), rms), colour, 8))
        out = [[k, p.rms] for k, p in enumerate(pairs) if not p.outcome.used and p.rms == p.rms]
        if out:
            series.append(frame.dots("left out", out, frame.RED, 12, symbol="diamond"))
        words = "Rms residual of every pair"
        plot = frame.chart("Pair", "Rms residual (px)", series, words=words, tooltip={"trigger": "item"})
        plot.on("chart:click", lambda event: self._clicked(event.args), args=["data"])

    def _clicked(self, event: object) -> None:
        if isinstance(event, dict) and isinstance(data := event.get("data"), list):
            self.slider.value = int(data[0])

    def _at(self, k: int) -> None:
        """Show a pair."""
        pair = self.found.pairs[k]
        self.about.text = pair_words(pair)
        self.about.classes(replace="soft" if pair.outcome.ok else "caution")
        scale = arrow_scale(self.found, self.series[0].shape[1])
        for image, pictures, view in zip(self.images, self.series, pair.views, strict=True):
            image.set_source(frame.source_of(pictures, k) if k < pictures.n_frames else "")
            image.content = "" if view is None else view_svg(view, scale, pictures.shape[1] / 400.0)


def arrow_scale(found: Calibration, columns: int) -> float:
    """Magnification of the residual arrows: the rms residual is `ARROW` of a picture's width."""
    return float(ARROW * columns / max(found.rms, 1e-9))


def view_svg(view: PairView, scale: float, width: float) -> str:
    """Detected points of a picture with their residuals enlarged, as SVG."""
    parts = []
    for (x, y), (dx, dy), used in zip(view.pixels, scale * view.residual, view.used, strict=True):
        colour = "#00c2ff" if used else "#ff3b30"
        parts.append(
            f'<circle cx="{x:.2f}" cy="{y:.2f}" r="{2.4 * width:g}" fill="none" stroke="{colour}" '
            f'stroke-width="{0.7 * width:g}"/>'
            f'<line x1="{x:.2f}" y1="{y:.2f}" x2="{x + dx:.2f}" y2="{y + dy:.2f}" '
            f'stroke="#ff5a00" stroke-width="{0.7 * width:g}" marker-end="url(#head)"/>'
        )
    head = (
        '<defs><marker id="head" orient="auto" markerWidth="4" markerHeight="4" refX="2" refY="2">'
        '<path d="M0 0L4 2L0 4Z" fill="#ff5a00"/></marker></defs>'
    )
    return head + "".join(parts)


def pair_words(pair: Pair) -> str:
    """Outcome of a pair, in words."""
    parts = [
        f"camera {i}: "
        + ("not recognised" if view is None else f"{len(view.ids)} points, {view.rms:.3f} px rms")
        for i, view in enumerate(pair.views)
    ]
    words = f"Pair {pair.name}: {'; '.join(parts)}"
    if pair.outcome.ok:
        return f"{words}."
    reason = f" ({pair.reason})" if pair.reason else ""
    return f"{words}. {pair.outcome.cause}{reason}; {pair.outcome.cure}."
