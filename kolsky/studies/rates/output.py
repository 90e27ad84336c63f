"""A rate report as tables, JSON and words."""

from collections.abc import Callable, Iterator
from typing import Any

from kolsky.base.files import columns_of, jsonable
from kolsky.results import numbers
from kolsky.results.numbers import plain_sentence
from kolsky.studies.rates.records import GroupRates, RatedShot, RateReport

Columns = dict[str, list[Any]]
"""Column heading, "name (unit)" for numbers -> its cells."""
Rows = Iterator[tuple[Any, ...]]
NAN = float("nan")
ROUTES = ("joint", "force only", "shape only", "paper")


def tables(report: RateReport) -> dict[str, Columns]:
    """The tables of a report: name -> columns. Missing numbers are NaN."""
    made = {
        "rate_shots": columns_of(row for group in report.groups for row in _shots(group)),
        "rate_groups": columns_of(map(_group_row, report.groups)),
    }
    for name, (rows_of, headings) in TABLES.items():
        rows = ((group.name, *row) for group in report.groups for row in rows_of(group))
        names = ["group", *headings]
        made[name] = columns_of((dict(zip(names, row, strict=True)) for row in rows), names)
    return made


def _shots(rates: GroupRates) -> Iterator[dict[str, Any]]:
    weight = {}
    if rates.slope is not None and rates.slope.fit is not None:
        named = zip(rates.counted, rates.slope.fit.leverage, strict=True)
        weight = {shot.name: float(leverage) for shot, leverage in named}
    yield from (_shot(shot, weight.get(shot.name, NAN)) for shot in rates.shots)


def _shot(shot: RatedShot, leverage: float) -> dict[str, Any]:
    h, terms = shot.history, shot.found.terms
    routes = {route.name: route for route in shot.found.routes}
    by_route: dict[str, float] = {}
    for name in ROUTES:
        route = routes.get(name)
        by_route[f"m {name} (1)"] = NAN if route is None else route.parameters.get("stiffness_factor", NAN)
        if name != "paper":
            sigma = NAN if route is None else route.sigma.get("stiffness_factor", NAN)
            by_route[f"u(m) {name} (1)"] = sigma
    return {
        "group": shot.group,
        "shot": shot.name,
        "nominal strain rate (1/s)": h.nominal_rate,
        "u of it (1/s)": h.sigma_rate,
        "true strain rate, 5 % of the strain (1/s)": h.true_rate[0],
        "true strain rate, 95 % of the strain (1/s)": h.true_rate[1],
        "spread of its log10 (decade)": h.spread,
        "averaged from (s)": h.span[0],
        "averaged to (s)": h.span[1],
        "largest nominal strain (1)": h.largest,
        "m (1)": shot.m,
        "u(m) (1)": shot.sigma,
        "U(m) k=2 (1)": 2.0 * shot.sigma,
        "u(m) own (1)": shot.sigma_own,
        **by_route,
        "Phi_F (N)": terms.phi_force,
        "Phi_S (1)": terms.phi_shape,
        "Phi (1)": terms.phi,
        "force residual over expected (1)": shot.excess("force"),
        "outline residual over expected (1)": shot.excess("outline"),
        "verdict": shot.verdict.value,
        "counted (0/1)": int(shot.counted),
        "leverage (1)": leverage,
        "warnings of its result (1)": len(shot.found.warnings),
        "rig": shot.rig,
        "SHA-256 of its quasi-static numbers": shot.quasi_static.source,
        "quasi-static strain rate (1/s)": NAN if shot.quasi_static.rate is None else shot.quasi_static.rate,
    }


def _group_row(group: GroupRates) -> dict[str, Any]:
    p, line, lever = group.pooled, group.slope, group.long_lever
    fit = None if line is None else line.fit

    def of(thing: Any, value: Callable[[Any], float]) -> float:
        return NAN if thing is None else float(value(thing))

    return {
        "group": group.name,
        "shots": len(group.shots),
        "counted": len(group.counted),
        "mean m (1)": of(p, lambda p: p.mean),
        "u (1)": of(p, lambda p: p.sigma),
        "u shared (1)": of(p, lambda p: p.sigma_common),
        "95 % low (1)": of(p, lambda p: p.interval[0]),
        "95 % high (1)": of(p, lambda p: p.interval[1]),
        "next shot, 95 % low (1)": of(p, lambda p: p.prediction[0]),
        "next shot, 95 % high (1)": of(p, lambda p: p.prediction[1]),
        "standard deviation s (1)": of(p, lambda p: p.scatter),
        "U = 2s (1)": of(p, lambda p: 2.0 * p.scatter),
        "scatter between shots tau (1)": of(p, lambda p: p.fit.between),
        "Q (1)": of(p, lambda p: p.fit.q),
        "degrees of freedom": of(p, lambda p: p.fit.freedom),
        "probability of Q (1)": of(p, lambda p: p.probability),
        "I^2 (1)": of(p, lambda p: p.fit.i_squared),
        "Knapp-Hartung factor (1)": of(p, lambda p: p.fit.scale),
        "reference rate (1/s)": of(line, lambda s: s.reference),
        "span of the rates (decade)": of(line, lambda s: s.span),
        "slope of m (1/decade)": of(fit, lambda f: f.coefficients[1]),
        "u of the slope (1/decade)": of(fit, lambda f: f.sigma(1)),
        "slope, 95 % low (1/decade)": of(fit, lambda f: f.interval(1)[0]),
        "slope, 95 % high (1/decade)": of(fit, lambda f: f.interval(1)[1]),
        "scatter about the line (1)": of(fit, lambda f: f.between),
        "slope detected with probability 0.9 (1/decade)": of(fit, lambda f: f.noticeable(1)),
        "slope may be claimed": "no verdict" if line is None else line.verdict.value,
        "decades to the quasi-static rate": of(lever, lambda v: v.decades),
        "slope from the quasi-static rate (1/decade)": of(lever, lambda v: v.slope),
        "its 95 % low (1/decade)": of(lever, lambda v: v.interval[0]),
        "its 95 % high (1/decade)": of(lever, lambda v: v.interval[1]),
    }


def _leave_one_out(rates: GroupRates) -> Rows:
    if rates.pooled is None or rates.slope is None:
        return
    fits = zip(rates.counted, rates.pooled.leave_one_out, rates.slope.leave_one_out, strict=True)
    for shot, mean, line in fits:
        yield (
            shot.name,
            *((NAN,) * 4 if mean is None else (mean.coefficients[0], *mean.interval(0), mean.between)),
            *((NAN,) * 3 if line is None else (line.coefficients[1], *line.interval(1))),
        )


def _criteria(rates: GroupRates) -> Rows:
    for c in () if rates.slope is None else rates.slope.criteria:
        yield c.name, c.value, c.limit, c.unit, int(c.at_least), int(c.met)


def _shared(rates: GroupRates) -> Rows:
    for (part, through), row in rates.common.items():
        for shot, change in zip(rates.counted, row, strict=True):
            if change != 0.0:
                yield part, through, shot.name, change


def _stiffness(rates: GroupRates) -> Rows:
    for at in rates.stiffness:
        for name, (value, sigma) in at.quantities.items():
            slow = rates.counted[0].quasi_static.rate
            yield "quasi-static", NAN if slow is None else slow, at.strain, name, *at.baseline[name]
            for shot, rate, *found in zip(at.shots, at.rates, value, sigma, strict=True):
                yield shot, rate, at.strain, name, *found


def _force(rates: GroupRates) -> Rows:
    if (e := rates.equal_strain) is not None:
        for k, strain in enumerate(e.strains):
            for i, shot in enumerate(e.shots):
                yield strain, shot, e.force[i, k], e.sigma[i, k], e.force_model[i, k]


def _shape(rates: GroupRates) -> Rows:
    for s in () if rates.equal_strain is None else rates.equal_strain.shapes:
        for point in zip(s.y, s.Z, s.sigma, s.model, strict=True):
            yield s.strain, s.shot, s.at, *point


def _quasi_static_force(rates: GroupRates) -> Rows:
    if (e := rates.equal_strain) is not None:
        yield from zip(e.baseline_strain, e.baseline_force, strict=True)


SLOPES = ["slope (1/decade)", "slope, 95 % low (1/decade)", "slope, 95 % high (1/decade)"]
STRAIN = "nominal strain (1)"
OUTLINE = ["strain of the frame (1)", "y (m)", "Z (m)", "sigma Z (m)", "Z simulated (m)"]
TABLES: dict[str, tuple[Callable[[GroupRates], Rows], list[str]]] = {
    "rate_leave_one_out": (
        _leave_one_out,
        ["without", "mean m (1)", "95 % low (1)", "95 % high (1)", "tau (1)", *SLOPES],
    ),
    "rate_criteria": (_criteria, ["criterion", "value", "limit", "unit", "at least (0/1)", "met (0/1)"]),
    "rate_shared": (_shared, ["part", "shared through", "shot", "moves m by (1)"]),
    "rate_stiffness": (_stiffness, ["shot", "strain rate (1/s)", STRAIN, "quantity", "value (Pa)", "u (Pa)"]),
    "rate_force_at_strain": (_force, [STRAIN, "shot", "force (N)", "sigma (N)", "simulated force (N)"]),
    "rate_shape_at_strain": (_shape, [STRAIN, "shot", *OUTLINE]),
    "rate_quasi_static_force": (_quasi_static_force, [STRAIN, "quasi-static force (N)"]),
    "rate_remarks": (lambda rates: ((remark,) for remark in rates.remarks), ["remark"]),
}
"""Rows of a group. Headings follow the group's name."""


def summary(report: RateReport) -> dict[str, Any]:
    """The report as one object of JSON types, with the names of the tables. Numbers that are not finite
    become null."""
    groups = [
        {
            **_group_row(group),
            "verdict": None if group.slope is None else group.slope.sentence,
            "in_common": group.in_common,
            "shots": list(_shots(group)),
            "remarks": group.remarks,
        }
        for group in report.groups
    ]
    said = {"grouped_by": report.grouped_by, "shared_relative_uncertainty": report.shared, "groups": groups}
    return {key: jsonable(value, key) for key, value in said.items()}


def rows(group: GroupRates, report: RateReport) -> dict[str, str]:
    """The numbers of one group of a report in words, for a terminal and `kolsky open`."""
    prefix = f"{group.name}: " if len(report.groups) > 1 else ""
    rows = {f"{prefix}shots": f"{len(group.counted)} of {len(group.shots)} counted"}
    for shot in group.shots:
        value, U = numbers.measured(shot.m, 2.0 * shot.sigma)
        rows[f"{prefix}{shot.name}"] = (
            f"m = {plain_sentence(value)} ± {plain_sentence(U)} (k = 2) at "
            f"{shot.history.nominal_rate:.4g} 1/s"
            f"{'' if shot.counted else ', not counted'}"
        )
    if group.pooled is not None:
        low, high = group.pooled.interval
        value, half = numbers.measured(group.pooled.mean, 0.5 * (high - low))
        rows[f"{prefix}mean m"] = f"{plain_sentence(value)} ± {plain_sentence(half)} (95 %)"
        rows[f"{prefix}scatter between shots"] = f"{group.pooled.fit.between:.2g}"
        low, high = (100.0 * share for share in group.own_range)
        rows[f"{prefix}in common (u of m)"] = ", ".join(group.in_common) or "nothing"
        rows[f"{prefix}each shot's own (u of m)"] = f"{low:.2g} to {high:.2g} %"
        rows[f"{prefix}U = 2s"] = f"{2.0 * group.pooled.scatter:.2g}"
    line = group.slope
    if line is not None:
        refused = bool(line.reasons)
        rows[f"{prefix}slope"] = line.verdict.value if refused else line.sentence
        for number, reason in enumerate(line.reasons, start=1):
            rows[f"{prefix}because {number}"] = reason
        if line.fit is not None and refused:
            low, high = line.fit.interval(1)
            middle = float(line.fit.coefficients[1])
            rows[f"{prefix}not supported: slope"] = f"{middle:.3g} per decade, 95 % {low:.3g} to {high:.3g}"
    if group.long_lever is not None:
        lever = group.long_lever
        rows[f"{prefix}from quasi-static"] = (
            f"{lever.slope:.2g} per decade, 95 % {lever.interval[0]:.2g} to {lever.interval[1]:.2g}"
        )
    return rows
