"""Pages of recordings: a test between bars, and a shot before any computation."""

from itertools import groupby
from typing import Any

from markupsafe import Markup

from kolsky.bars.records import FlyerResult, ReducedTest
from kolsky.report.pages.rendering import draw_figures, render_page
from kolsky.results import numbers
from kolsky.results.nomenclature import typeset
from kolsky.shot.bars import CheckedBars
from kolsky.shot.records import ShotBase
from kolsky.shot.summary import ABSOLUTE, EXACT, Entry, remarks, summarise

SHOWN = {"Pa": (1e-6, "MPa"), "s": (1e6, "µs"), "m": (1e3, "mm"), "1/V": (1e6, "µm/m/V")}
"""Factor and unit of the page by SI unit; other units are shown unchanged."""


def render(result: ReducedTest) -> str:
    """Return the page as HTML text."""
    quoted = list(result.budget.results)
    return render_page(
        "waves.html",
        heading=result.name,
        subject="bar signals",
        result=result,
        figures=draw_figures(result),
        answers=answers(result),
        means_over=typeset(means_over(result)),
        facts=[(name, typeset(quantity(value, unit))) for name, (value, unit) in result.facts.items()],
        corrections=[
            {
                "Correction": Markup("{} <code>{}</code>").format(c.name, c.key),
                "Applied": "yes" if c.applied else "no",
                "Largest change": typeset(quantity(c.size, c.unit)),
                "rms change": typeset(quantity(c.rms, c.unit)),
                "Reason": typeset(c.reason),
            }
            for c in result.corrections
        ],
        kind="Forces and motion of a flyer test, classical reduction"
        if isinstance(result, FlyerResult)
        else f"Bar signals, classical reduction in {result.load}",
        flyer=result if isinstance(result, FlyerResult) else None,
        events=[
            {
                "Event": name,
                "Time": "not found" if at is None else f"{1e3 * at:.4f}\N{NO-BREAK SPACE}ms",
                "U (k = 2)": "" if sigma is None else typeset(f"{2e6 * sigma:.2g} µs"),
                "How it was found": typeset(how),
            }
            for name, at, sigma, how in (result.events if isinstance(result, FlyerResult) else ())
        ],
        budget=[
            {
                "Input": row.quantity.name,
                "Value": typeset(quantity(row.quantity.value, row.quantity.unit)),
                "u (k = 1)": typeset(quantity(row.quantity.sigma, row.quantity.unit)),
                "Kind": row.quantity.kind,
                **{name: f"{100.0 * row.shares.get(name, 0.0):.0f} %" for name in quoted},
            }
            for row in result.budget.contributions
        ],
        sensitivity=sensitivity_rows(result),
        settings=list(result.settings.items()),
        inputs=list(result.inputs.items()),
    )


def sensitivity_rows(result: ReducedTest) -> list[dict[str, Any]]:
    """Return the change of each result for one standard uncertainty of each input, with its sign.

    Below it is the sensitivity coefficient, in the value's SI unit per SI unit of the input.
    """
    rows = []
    for row in result.budget.contributions:
        if not row.sensitivity:
            continue
        q = row.quantity
        cells = {"Input": q.name, "u (k = 1)": typeset(quantity(q.sigma, q.unit))}
        for name, (_, _, unit) in result.budget.results.items():
            slope = row.sensitivity.get(name)
            change = "" if slope is None else signed(slope * q.sigma, unit)
            below = "" if slope is None else per(slope, unit, q.unit)
            cells[name] = Markup("{}<br><small>{}</small>").format(change, below)
        rows.append(cells)
    return rows


def signed(value: float, unit: str) -> str:
    """Return a change with its sign, three digits, in the unit of the page."""
    factor, shown = SHOWN.get(unit, (1.0, unit))
    text = f"{factor * value:+.3g}" if value else "0"
    return typeset(text + ("" if shown == "1" else f" {shown}"))


def per(slope: float, unit: str, of: str) -> str:
    """Return a sensitivity coefficient with its sign, in SI: value's unit per input's unit."""
    text = f"{slope:+.3g}" if slope else "0"
    each = "" if of == "1" else f" per {of}"
    return typeset(text + ("" if unit == "1" else f" {unit}") + each)


def means_over(result: ReducedTest) -> str:
    """Return the span of the means, and the duration of force balance, in words. Empty if unknown."""
    named = (
        "plateau from",
        "plateau to",
        "balanced length of the plateau",
        "incident pulse at half its height",
    )
    if any(name not in result.facts for name in named):
        return ""
    first, last, balanced, whole = (result.facts[name][0] for name in named)
    return (
        f"Means over {1e6 * first:.4g} to {1e6 * last:.4g} µs; on the plateau the forces are balanced over "
        f"{1e6 * balanced:.3g} µs, {100.0 * balanced / whole:.0f} % of the incident pulse."
    )


def answers(result: ReducedTest) -> list[dict[str, str]]:
    """Return the quoted results with U = 2 u, in the units of the page."""
    rows = []
    for name, (value, sigma, unit) in result.budget.results.items():
        factor, shown = SHOWN.get(unit, (1.0, unit))
        best, expanded = numbers.measured(factor * value, 2.0 * factor * sigma)
        unit = "" if shown == "1" else shown
        rows.append({"Quantity": name, "Value": typeset(best), "U": expanded, "Unit": unit})
    return rows


def quantity(value: float, unit: str) -> str:
    """Return a number with four digits in the unit of the page. A time on a long clock keeps all digits."""
    if unit == "s" and abs(value) >= ABSOLUTE:
        return f"{value:.9f} s"
    factor, shown = SHOWN.get(unit, (1.0, unit))
    if unit == "Pa" and abs(value) >= 1e9:
        factor, shown = 1e-9, "GPa"
    if unit == "1" and 0.0 < abs(value) < 1e-2:
        factor, shown = 1e6, "µm/m"
    return f"{factor * value:.4g}" + ("" if shown == "1" else f" {shown}")


PAGE = "check.html"


def render_check(shot: ShotBase | CheckedBars) -> str:
    """Return the page as HTML text."""
    entries = [entry for entry in summarise(shot) if entry.value != EXACT]
    tables = [
        (section, [(entry.name.replace("_", " "), _shown(entry)) for entry in rows])
        for section, rows in groupby(entries, lambda entry: entry.section)
    ]
    return render_page(
        "check.html",
        kind="Contents of a shot",
        heading=shot.name,
        subject="check",
        figures=draw_figures(shot),
        tables=tables,
        remarks=remarks(shot),
        exact=[entry.name for entry in summarise(shot) if entry.value == EXACT],
        inputs=list(shot.inputs.items()),
    )


def _shown(entry: Entry) -> str:
    """Return a value as text for a page. Words from a file are unchanged."""
    return entry.written() if isinstance(entry.value, str) else typeset(entry.written())
