"""Views of any result: HTML for IPython, a figure, tables for pandas.

The tables are those of `kolsky.report.result_folder.tables_of`, by the names of the CSV files. The views are
functions of the data, and the data do not import them. `kolsky.report.ipython` registers them as the methods
of `dic.views.ResultViews`.
"""

from __future__ import annotations

from functools import singledispatch
from math import nan
from typing import TYPE_CHECKING, Any

import numpy as np

from dic import output as surface_views
from dic.output import html_table, pandas
from dic.result import FullField
from dic.surfaces.surface_history import SurfaceHistory
from kolsky.inverse.result import Identification
from kolsky.report.result_folder import has_tables, tables_of
from kolsky.results.printed import answer, details, fit_line, summary
from kolsky.shot.records import ShotBase
from kolsky.shot.summary import summarise

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["html", "plot", "to_dataframe"]


@singledispatch
def html(data: object) -> str | None:
    """Return a shot, a measured surface or an identification as an HTML table, None for other types."""
    return None


@singledispatch
def to_dataframe(data: object, table: str = "") -> Any:
    """Return a shot, a measured surface or any result as a pandas table (SI, units in the headers).

    Parameters
    ----------
    data
        A shot: one row per value of its file. A surface: one row per point and frame. Or any result; else
        TypeError.
    table
        Name of one of the result's CSV files, without ".csv"; default: the main file; ValueError if there is
        no such table. An identification has "estimates" (the default), "routes", "force", "profile", "design"
        and "energy". A displacement field also has "points", one row per point and frame.

    Examples
    --------
    >>> import kolsky
    >>> frame = kolsky.to_dataframe(kolsky.waves("runs/bar-01"))
    >>> "time (s)" in frame.columns
    True
    """
    if not has_tables(data):
        name = type(data).__name__
        raise TypeError(f"{name} has no view for pandas; shots, surfaces and results have one")
    return _frame_of(data, table)


def _frame_of(data: object, table: str) -> Any:
    reader = pandas()
    known = {name.rpartition("/")[2]: columns for name, columns in tables_of(data).items()}
    name = table or next(iter(known))
    if name not in known:
        raise ValueError(f"there is no table {name!r}; choose from {', '.join(known)}")
    return reader.DataFrame({heading: _cells(cells) for heading, cells in known[name].items()})


def _cells(cells: Any) -> Any:
    """A column. An empty cell among numbers becomes NaN."""
    if isinstance(cells, np.ndarray) or all(isinstance(cell, str) for cell in cells):
        return cells
    return [nan if isinstance(cell, str) and not cell else cell for cell in cells]


@html.register
def _(data: ShotBase) -> str:
    rows = [(f"{e.section}, {e.name.replace('_', ' ')}", e.written()) for e in summarise(data)]
    return html_table(f"Shot {data.name}", rows)


@html.register
def _(data: SurfaceHistory) -> str:
    return html_table("Measured surface", surface_views.facts(data))


@html.register
def _(data: Identification) -> str:
    first = "; ".join(answer(estimate) for estimate in data.estimates.values())
    short = [("fit", fit_line(data).removeprefix("fit: ")), *summary(data).items()]
    short += [("warning", text) for text in data.warnings]
    table = html_table("Every value", list(details(data).items()))
    return f"{html_table(first, short)}<details><summary>Every value</summary>{table}</details>"


@to_dataframe.register
def _(data: ShotBase, table: str = "") -> Any:
    entries = summarise(data)
    names = ("section", "name", "value", "unit")
    return pandas().DataFrame({n: [getattr(e, n) for e in entries] for n in names})


@to_dataframe.register
def _(data: SurfaceHistory, table: str = "") -> Any:
    return surface_views.to_dataframe(data)


@to_dataframe.register
def _(data: FullField, table: str = "") -> Any:
    if table == "points":
        return surface_views.points_dataframe(data)
    return _frame_of(data, table)


def plot(data: object, figure: str = "") -> Figure:
    """Draw a figure of a result, as the reports do, with its caption as label.

    ``data``: a shot or any result. A displacement field or a surface is drawn without its pictures, a rate
    report by its first material, a sweep over the range of its points. ``figure``: name of the figure, which
    is that of its file under ``--figures``; default: the first one. Raises TypeError if no figure shows such
    a result, and ValueError, with the names, if there is no figure of that name.

    Examples
    --------
    >>> import kolsky
    >>> kolsky.waves("runs/bar-01").plot("waves").axes[0].get_xlabel()
    'Time at the gauge (µs)'
    """
    from kolsky.report.canvas import build
    from kolsky.report.figures import figures_of

    shown = _drawn(data)
    known = {kind.name: kind for kind in figures_of(shown).values() if kind.applies(shown)}
    name = figure or next(iter(known), "")
    if name not in known:
        raise ValueError(f"there is no figure {name!r}; choose from {', '.join(known) or 'none'}")
    return build(known[name], shown)


def _drawn(data: Any) -> Any:
    """The object for the figures of a result: the result or its view."""
    from kolsky.report import picture_views

    match type(data).__name__:
        case "FullField":
            return picture_views.full_field_view(data)
        case "StereoResult":
            return picture_views.surface_view(data)
        case "RateReport":
            return data.groups[0]
        case "Sweep":
            from doe import Box
            from kolsky.studies.sweep_analysis import analyse_sweep

            ends = zip(data.table.points.min(axis=0), data.table.points.max(axis=0), strict=True)
            return analyse_sweep(
                data.shot, Box.of(dict(zip(data.table.names, ends, strict=True))), data.table
            )
        case "SpecimenFit":
            from kolsky.report.body_views import view_of

            return view_of(data.tests[0].test.name, [data])
    return data
