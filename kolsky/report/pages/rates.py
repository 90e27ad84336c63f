"""Page of the stiffness of several shots against their strain rates, with the tables of each group."""

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from markupsafe import Markup

from kolsky.report.figures import RATES, FigureKind
from kolsky.report.pages.rendering import draw_figures, render_page, sentences
from kolsky.results import numbers
from kolsky.results.nomenclature import upper_first
from kolsky.results.numbers import NOTHING, measured, percent, plain
from kolsky.studies.rates.records import GroupRates, RatedShot, RateReport
from kolsky.studies.rates.scatter import Criterion, Slope, SlopeVerdict


def _group_tables(group: GroupRates, *, several: bool) -> dict[str, Any]:
    """Return all tables of a group for the template."""
    leverage: dict[str, float] = {}
    if group.slope is not None and group.slope.fit is not None:
        pairs = zip(group.counted, group.slope.fit.leverage.tolist(), strict=True)
        leverage = {shot.name: share for shot, share in pairs}
    return {
        "name": group.name,
        "suffix": f", {group.name}" if several else "",
        "counted": len(group.counted),
        "answer": _answer_lines(group),
        "slope": None if group.slope is None else _slope(group.slope),
        "lever": _lever(group),
        "remarks": sentences(group.remarks),
        "shots": [_shot_row(shot, leverage.get(shot.name)) for shot in group.shots],
        "average": mean_and_scatter(group),
        "heterogeneity": _heterogeneity(group),
        "criteria": [] if group.slope is None else [_criterion(c) for c in group.slope.criteria],
        "without": _without(group),
        "shared": _shared(group),
    }


def _answer_lines(group: GroupRates) -> dict[str, str] | None:
    p = group.pooled
    if p is None:
        return None
    mean, low, high = _ends(p.mean, p.interval)
    rates = [shot.history.nominal_rate for shot in group.counted]
    return {
        "mean": mean,
        "low": low,
        "high": high,
        "rates": f"{plain(min(rates), 3)} to {plain(max(rates), 3)} 1/s",
        "tau": plain(p.fit.between, 2),
        "U": plain(2.0 * p.scatter, 2),
    }


def _ends(value: float, interval: tuple[float, float]) -> tuple[str, str, str]:
    """A value and the ends of its interval. They are rounded according to the half width."""
    half = 0.5 * (interval[1] - interval[0])
    return measured(value, half)[0], numbers.like(interval[0], half), numbers.like(interval[1], half)


def _slope(line: Slope) -> dict[str, Any]:
    shown: dict[str, Any] = {
        "verdict": line.verdict.value,
        "refused": line.verdict is SlopeVerdict.REFUSED,
        "reasons": line.reasons,
        "value": "",
    }
    if line.fit is not None:
        value, low, high = _ends(float(line.fit.coefficients[1]), line.fit.interval(1))
        shown |= {"value": value, "low": low, "high": high, "noticed": plain(line.fit.noticeable(1), 2)}
    if line.fit is not None and line.verdict is SlopeVerdict.NONE_SEEN:
        bound = max(abs(end) for end in line.fit.interval(1))
        shown["verdict"] = f"{line.verdict.value} beyond ± {plain(bound, 2)} per decade"
    return shown


def _lever(group: GroupRates) -> dict[str, str] | None:
    lever = group.long_lever
    if lever is None:
        return None
    slope, low, high = _ends(lever.slope, lever.interval)
    return {"decades": numbers.rounded(lever.decades, -1), "slope": slope, "low": low, "high": high}


def _shot_row(shot: RatedShot, leverage: float | None) -> dict[str, Any]:
    h, terms, U = shot.history, shot.found.terms, 2.0 * shot.sigma
    routes = {route.name: route for route in shot.found.routes}
    value, expanded = measured(shot.m, U)

    def alone(name: str) -> str:
        route = routes.get(name)
        m = np.nan if route is None else route.parameters.get("stiffness_factor", np.nan)
        return numbers.like(m, U)

    low, high = (plain(rate, 3) for rate in h.true_rate)
    return {
        "name": shot.name,
        "rate": plain(h.nominal_rate, 3),
        "true": f"{low} to {high}",
        "strain": numbers.rounded(h.largest, -2),
        "m": value,
        "U": expanded,
        "own": numbers.part(2.0 * shot.sigma_own, U),
        "force": alone("force only"),
        "shape": alone("shape only"),
        "phi_force": plain(terms.phi_force, 3),
        "phi_shape": plain(terms.phi_shape, 3),
        "leverage": NOTHING if leverage is None else numbers.rounded(leverage, -2),
        "fit": ", ".join(plain(shot.excess(c), 2) for c in ("force", "outline")),
        "verdict": shot.verdict.value,
        "counted": shot.counted,
    }


def mean_and_scatter(group: GroupRates) -> dict[str, str]:
    """Return mean and U = 2 s of each column, as the two last lines of Table 2 of Mates et al. (2012)."""
    if group.pooled is None:
        return {}
    columns = {
        "rate": [shot.history.nominal_rate for shot in group.counted],
        "m": [shot.m for shot in group.counted],
        "phi_force": [shot.found.terms.phi_force for shot in group.counted],
        "phi_shape": [shot.found.terms.phi_shape for shot in group.counted],
    }
    shown = {}
    for name, column in columns.items():
        U = 2.0 * float(np.std(column, ddof=1))
        mean = float(np.mean(column))
        shown[name] = measured(mean, U)[0] if name == "m" else plain(mean, 3)
        shown[f"U_{name}"] = plain(U, 2)
    return shown


def _heterogeneity(group: GroupRates) -> list[tuple[str, str]]:
    p = group.pooled
    if p is None:
        return []
    _, low, high = _ends(p.mean, p.prediction)
    mean, u = measured(p.mean, p.sigma)
    return [
        ("random-effects mean, u", f"{mean}, {u}"),
        ("part of u that the shots share", plain(p.sigma_common, 2)),
        ("scatter between shots τ", plain(p.fit.between, 2)),
        ("standard deviation s of the shots", plain(p.scatter, 2)),
        ("Cochran’s Q", f"{plain(p.fit.q, 3)} with {p.fit.freedom} degrees of freedom"),
        ("probability of such a Q by noise alone", plain(p.probability, 2)),
        ("I², share of the scatter not from noise", percent(p.fit.i_squared)),
        ("Knapp and Hartung’s factor", plain(p.fit.scale, 3)),
        ("one more shot, 95 %", f"{low} to {high}"),
    ]


def _criterion(c: Criterion) -> dict[str, Any]:
    unit = "" if c.unit == "1" else f" {c.unit}"
    return {
        "Condition": upper_first(c.name),
        "Is": plain(c.value, 3) + unit if np.isfinite(c.value) else "no spread known",
        "Needed": f"{'≥' if c.at_least else '≤'} {plain(c.limit, 3)}{unit}",
        "Met": "yes" if c.met else "no",
        "lost": not c.met,
    }


MEAN = Markup("Mean <i>m</i>")


def _without(group: GroupRates) -> list[dict[str, str]]:
    if group.pooled is None or group.slope is None:
        return []
    rows = []
    fits = zip(group.counted, group.pooled.leave_one_out, group.slope.leave_one_out, strict=True)
    for shot, mean, line in fits:
        headings = (MEAN, "95 % interval", "τ", "Line, per decade")
        row = {"Without": shot.name, **dict.fromkeys(headings, NOTHING)}
        if mean is not None:
            row[MEAN], low, high = _ends(float(mean.coefficients[0]), mean.interval(0))
            row["95 % interval"] = f"{low} to {high}"
            row["τ"] = plain(mean.between, 2)
        if line is not None:
            start, end = line.interval(1)
            value, half_width = measured(float(line.coefficients[1]), 0.5 * (end - start))
            row["Line, per decade"] = f"{value} ± {half_width}"
        rows.append(row)
    return rows


def _shared(group: GroupRates) -> list[dict[str, str]]:
    rows = []
    for (part, through), changes in group.common.items():
        moved = np.abs(changes[changes != 0.0])
        low, high = plain(float(moved.min()), 2), plain(float(moved.max()), 2)
        # A file is identified by its hash. Eight digits are unique on a page.
        short = through[:8] if re.fullmatch("[0-9a-f]{64}", through) else through
        change = low if low == high else f"{low} to {high}"
        row = {"Part": upper_first(part), "Through": short, "Shots": str(moved.size)}
        rows.append({**row, Markup("Moves <i>m</i> by"): change})
    return rows


def render(report: RateReport) -> str:
    """Return the page as HTML text."""
    groups, number = [], 1
    for index, group in enumerate(report.groups):
        shown = _group_tables(group, several=len(report.groups) > 1)
        shown["figures"] = draw_figures(group, figures_of(report, index).values(), first=number)
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
    """Return the figures of one group. If there are several groups, names end in the group's number."""
    group = report.groups[index]
    suffix = f"-{index + 1}" if len(report.groups) > 1 else ""
    return {
        f"{name}{suffix}": replace(kind, name=f"{name}{suffix}")
        for name, kind in RATES.items()
        if kind.applies(group)
    }
