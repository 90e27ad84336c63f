"""Page of an identification: the answers and their uncertainty, the data, the search, the numerical error."""

from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import Environment

from kolsky.inverse.result import Identification
from kolsky.report import nomenclature, numbers
from kolsky.report.display_units import in_display_units
from kolsky.report.figures import RECORDINGS, REGISTRY
from kolsky.report.fit_table import fit_tables
from kolsky.report.held_line import held_line
from kolsky.report.nomenclature import in_words, name_of, route_label
from kolsky.report.pages.causes import cause_table
from kolsky.report.pages.identification_tables import (
    answer,
    check_run,
    facts,
    failures,
    fixed,
    flattened,
    quality,
    runs,
    shown_unit,
)
from kolsky.report.pages.instrument import instrument
from kolsky.report.pages.rendering import (
    FigureGroup,
    draw_groups,
    environment,
    render_page,
    script,
    write_html,
)
from kolsky.report.pages.uncertainty import changes, choices, likelihood_tables
from kolsky.shot.recorded import Recorded

_TEMPLATE = "identification.html"
_TESTED = ("specimen", "specimen_length", "interface", "declared_interface", "support", "window_s")
_TABLES = ("checks", "inputs", "settings", "versions")
_SHOWN = (*_TESTED, *_TABLES, "recordings")
"""Entries of provenance that have their own table; all others are listed under "Further"."""


def write_report(
    path: Path,
    identification: Identification,
    recordings: Recorded | None = None,
    *,
    processes: int = 1,
    ahead: Mapping[str, Callable[[], str]] | None = None,
) -> None:
    """Write the report of one shot as a single HTML file that needs no network.

    Parameters
    ----------
    path : Path
        The file, replaced atomically if it exists; its folder must exist.
    identification : Identification
        The result. Of its provenance, "specimen", "specimen_length", "interface", "declared_interface",
        "support" and "window_s" make the table of the test; "checks", "inputs" (file name to SHA-256),
        "settings" and "versions" have their own tables; every other entry is listed under "Further".
    recordings : Recorded, optional
        Recordings of the shot's own files; without them their sections are left out.
    processes : int
        Processes that draw; see `dic.forks.side_by_side`.
    ahead : mapping, optional
        As of `kolsky.report.pages.rendering.draw_groups`.

    Raises
    ------
    OSError
        If the file cannot be written; an older one is then unchanged.
    """
    write_html(path, render(identification, recordings, processes=processes, ahead=ahead))


def render(
    identification: Identification,
    recordings: Recorded | None = None,
    *,
    processes: int = 1,
    ahead: Mapping[str, Callable[[], str]] | None = None,
) -> str:
    """Return the report as HTML text; see `write_report`."""
    result = in_display_units(identification)
    provenance = result.provenance
    figures = _figures(identification, result, recordings, processes, ahead)
    return render_page(
        _TEMPLATE,
        using=_templates(),
        kind="Identification from one impact test",
        heading=result.shot,
        subject="identification",
        result=result,
        figures=figures,
        instrument=instrument(identification, recordings),
        script=script("instrument.js"),
        answers=[answer(estimate) for estimate in result.estimates.values()],
        facts=facts(result),
        fit=fit_tables(result),
        fixed=fixed(result),
        held=None if result.held_answer is None else held_line(result.held_answer, written=True),
        check=check_run(result),
        runs=runs(result),
        U={name: 2.0 * estimate.sigma for name, estimate in result.estimates.items()},
        quality=quality(result),
        tables=likelihood_tables(result),
        changes=changes(result),
        causes=cause_table(identification),
        choices=choices(result),
        recordings=flattened({"recordings": provenance.get("recordings", {})}),
        recorded=recordings,
        tested=flattened({key: provenance[key] for key in _TESTED if key in provenance}),
        **{name: flattened(provenance.get(name, {})) for name in _TABLES},
        further=flattened({k: v for k, v in provenance.items() if k not in _SHOWN}),
        completed=len(result.design.outcomes) - len(result.design.lost),
        failures=failures(result),
        total_seconds=sum(result.seconds.values()),
    )


def _figures(
    identification: Identification,
    result: Identification,
    recordings: Recorded | None,
    processes: int,
    ahead: Mapping[str, Callable[[], str]] | None,
) -> dict[str, dict[str, Any]]:
    """Draw all figures, those of the recordings first; by name, as the template takes them.

    The template removes each figure that it places; the others follow under "Further figures".
    """
    groups = [FigureGroup(REGISTRY.values(), identification, captioned=result)]
    if recordings is not None:
        groups.insert(0, FigureGroup(RECORDINGS.values(), recordings))
    drawn = draw_groups(groups, processes=processes, ahead=ahead)
    return {figure["id"].replace("-", "_"): figure for figure in drawn}


def load_template() -> None:
    """Read and compile the page's template before it is wanted; it is kept."""
    _templates().get_template(_TEMPLATE)


@cache
def _templates() -> Environment:
    """Return the templates with the filters that this page needs."""
    templates = environment()
    templates.filters |= {
        "plain": numbers.plain,
        "percent": numbers.percent,
        "name_of": name_of,
        "route_label": route_label,
        "in_words": in_words,
        "stage_label": lambda stage: nomenclature.STAGES.get(stage, stage),
    }
    templates.globals |= {
        "like": numbers.like,
        "uncertainty": lambda value, U: numbers.measured(value, U)[1],
        "unit": shown_unit,
    }
    return templates
