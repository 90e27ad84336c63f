"""The view of several shots: force and outline over time, stiffness over strain rate."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from nicegui import ui

from kolsky.app import frame
from kolsky.app.shots import list_shots
from kolsky.base.errors import InputError
from kolsky.inverse.result import Identification
from kolsky.report.result_folder import RESULT_FILE
from kolsky.results.hdf5 import read_identification
from kolsky.studies.rates.output import rows
from kolsky.studies.rates.rate import rate
from kolsky.studies.rates.records import GroupRates, RateReport

SHADES = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#8f6a00", "#1a1a1a", "#7a5195")
"""Colours of the shots (Okabe and Ito 2008, those dark enough on white)."""


def page(root: Path) -> None:
    """Register the page."""

    @ui.page("/compare", response_timeout=30.0)
    async def compare_page(shots: str = "") -> None:
        with frame.framed("Compare", view="compare"):
            names = [name for name in shots.split(frame.BETWEEN) if name]
            identified = {one.name: one.name for one in list_shots(root) if one.row}
            if not identified:
                frame.note("No shot below this folder has a result yet.")
                return
            with ui.row().classes("w-full items-center gap-3 no-wrap"):
                chosen = ui.select(
                    identified, value=[n for n in names if n in identified], multiple=True, label="Shots"
                )
                chosen.classes("grow").props("use-chips outlined dense")
                ui.button("Compare", on_click=lambda: ui.navigate.to(frame.comparison(*chosen.value))).props(
                    "outline"
                )
            target = ui.column().classes("w-full")
            if names:
                with target:
                    await _compare(root, names, target)


async def _compare(root: Path, names: Sequence[str], target: ui.column) -> None:
    folders = {name: frame.folder_at(root, name) for name in names}
    results = await frame.opened(
        "The results are read ...",
        lambda: {n: read_identification(f / "results" / RESULT_FILE) for n, f in folders.items()},
    )
    with target:
        with ui.element("div").classes("grid2"):
            _forces(results)
            _outlines(results)
        frame.heading("Stiffness over strain rate")
        studied = frame.note("The rate study reads the shots ...")
    try:
        report = await frame.in_thread(rate, list(folders.values()))
    except (InputError, ValueError) as error:
        studied.text = f"There is no rate study of these shots: {error}"
        return
    studied.delete()
    with target:
        _rates(report)


def _forces(results: dict[str, Identification]) -> None:
    series = []
    for (name, one), colour in zip(results.items(), SHADES * len(results), strict=False):
        c = one.comparison
        series.append(frame.dots(name, frame.points(1e6 * c.force_time, c.force_measured), colour, 2.5))
        model = frame.line(name, frame.points(1e6 * c.force_time, c.force_model), colour)
        series.append(model)
    frame.chart(
        "Time (µs)",
        "Transmitted force (N)",
        series,
        words="Forces of the shots: dots measured, lines simulated",
    )


def _outlines(results: dict[str, Identification]) -> None:
    """The largest measured radius over time: one curve per shot."""
    series = []
    for (name, one), colour in zip(results.items(), SHADES * len(results), strict=False):
        line = one.comparison.centre_line
        if not line.time.size:
            continue
        times = np.unique(line.time)
        widest = [1e3 * float(line.Z[line.time == t].max()) for t in times]
        series.append(frame.line(name, frame.points(1e6 * times, widest), colour))
    if series:
        frame.chart(
            "Time (µs)", "Largest measured radius (mm)", series, words="Largest radius of the shots over time"
        )


def _rates(report: RateReport) -> None:
    for group in report.groups:
        if len(report.groups) > 1:
            frame.heading(group.name, 3)
        with ui.element("div").classes("grid2"):
            _rate_plot(group)
            with ui.column().classes("w-full gap-1"):
                for name, words in rows(group, report).items():
                    ui.label(f"{name}: {words}")
                for words in group.remarks:
                    frame.note(words, "caution")


def _rate_plot(group: GroupRates) -> None:
    counted = [s for s in group.shots if s.counted]
    left_out = [s for s in group.shots if not s.counted]
    bars = [[s.history.nominal_rate, s.m - 2.0 * s.sigma, s.m + 2.0 * s.sigma] for s in group.shots]
    lines = [frame.line("", [[x, low], [x, high]], frame.SOFT, silent=True) for x, low, high in bars]
    plot = frame.chart(
        "Nominal strain rate (1/s)",
        "Stiffness factor m",
        [
            *lines,
            frame.dots("counted", [[s.history.nominal_rate, s.m, s.name] for s in counted], frame.BLUE, 9),
            frame.dots(
                "not counted", [[s.history.nominal_rate, s.m, s.name] for s in left_out], frame.ORANGE, 9
            ),
        ],
        words="Stiffness factor over strain rate, bars are U (k = 2)",
        tooltip={"show": False},
    )
    plot.options["legend"]["data"] = ["counted", "not counted"]
