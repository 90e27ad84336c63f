"""Page of the stiffness of several shots against their strain rates."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from kolsky.report.figures import RATES, FigureKind
from kolsky.report.numbers import percent
from kolsky.report.pages.rate_tables import group_tables
from kolsky.report.pages.rendering import draw_figures, render_page, write_html
from kolsky.studies.rates.records import RateReport


def write_page(path: Path, report: RateReport) -> None:
    """Write the page as a single HTML file without scripts or outside resources.

    Raises
    ------
    OSError
        If the file cannot be written; an older one is then unchanged.
    """
    write_html(path, render(report))


def render(report: RateReport) -> str:
    """Return the page as HTML text; see `write_page`."""
    groups, number = [], 1
    for index, group in enumerate(report.groups):
        shown = group_tables(group, several=len(report.groups) > 1)
        shown["figures"] = draw_figures(figures_of(report, index).values(), group, first=number)
        number += len(shown["figures"])
        groups.append(shown)
    total = sum(len(group.shots) for group in report.groups)
    several = f" in {len(groups)} groups by {report.grouped_by}" if len(groups) > 1 else ""
    return render_page(
        "rates.html",
        kind="Stiffness against strain rate",
        heading=f"{total} shot{'' if total == 1 else 's'}{several}",
        subject="stiffness against strain rate",
        report=report,
        groups=groups,
        shared=percent(report.shared),
    )


def figures_of(report: RateReport, index: int) -> Mapping[str, FigureKind[Any]]:
    """Return the figures of one group; their names end in its number if there are several groups."""
    group = report.groups[index]
    suffix = f"-{index + 1}" if len(report.groups) > 1 else ""
    return {
        f"{name}{suffix}": replace(kind, name=f"{name}{suffix}")
        for name, kind in RATES.items()
        if kind.applies(group)
    }
