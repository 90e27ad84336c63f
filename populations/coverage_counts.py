"""Coverage of the intervals of a study, and the range expected of exact intervals.

`python -m populations.coverage_counts SUMMARY ...` prints the table of a `summary.json`.
"""

from typing import Any

import numpy as np
from scipy.stats import binom, binomtest

from kolsky.inverse.result import Verdict
from populations.driver import print_tables

NOMINAL = 0.9545
"""Probability of an interval of k = 2 of a normal distribution."""
WANTED = (0.92, 0.98)
"""Required range of the coverage in a study of 200 experiments."""
LARGEST_MEAN = 0.25
"""Required limit of the mean error over the mean standard uncertainty."""

ANSWERS = frozenset(verdict.value for verdict in Verdict if verdict.identified)
"""Verdicts that report a value as an answer."""

UNITS = {"damping": (1e6, "µs")}
"""Factor and unit of parameters that are not shown in SI units."""
SYMBOLS = {"stiffness_factor": "$m$", "poisson": "$\\nu$", "damping": "$\\beta$", "friction": "$f$"}

Each = list[dict[str, Any]]
"""Experiments, each the fields of `populations.coverage.Found`."""


def summary(each: Each) -> dict[str, Any]:
    """Coverage, errors and standard uncertainties of each parameter. A missing answer counts as not
    covering."""
    n = len(each)
    low, high = binom.interval(0.95, n, NOMINAL)
    outcomes = sorted({one["outcome"] for one in each})
    return {
        "experiments": n,
        "exact interval, 95 % of studies": [low / n, high / n],
        "outcomes": {text: sum(one["outcome"] == text for one in each) for text in outcomes},
        "with a warning that force and outline disagree": sum(
            any("outline disagree" in text for text in one.get("warnings", [])) for one in each
        ),
        "called identified": sum(called_identified(one) for one in each),
        **{name: _parameter(name, each) for name in each[0]["truth"]},
    }


def called_identified(one: dict[str, Any]) -> bool:
    """True if every verdict of an experiment is an answer, also if it is based on one channel only."""
    return all(text in ANSWERS for text in one["outcome"].split("; "))


def _parameter(name: str, each: Each) -> dict[str, Any]:
    good = [one for one in each if np.isfinite(one["value"][name])]
    error = np.array([one["value"][name] - one["truth"][name] for one in good])
    sigma = np.array([one["sigma"][name] for one in good])
    correction = np.array([one["correction"][name] for one in good])
    parts = [one["parts"][name] for one in good]
    sources = sorted({source for part in parts for source in part})
    held = int((np.abs(error) <= 2.0 * sigma).sum())
    share, mean = held / len(each), float(error.mean())
    misses = {"above": int((error > 2.0 * sigma).sum()), "below": int((error < -2.0 * sigma).sum())}
    # If both sides are equally likely, all n misses are on one side with probability 1 / 2^(n - 1).
    lopsided = binomtest(misses["above"], max(sum(misses.values()), 1)).pvalue < 0.05
    within = [  # an open end is NaN, and comparisons with NaN are false
        not (one["truth"][name] < one["profile"][name][0] or one["truth"][name] > one["profile"][name][1])
        for one in good
        if name in one["profile"]
    ]
    answered = [one for one in good if called_identified(one)]
    inside = sum(abs(one["value"][name] - one["truth"][name]) <= 2.0 * one["sigma"][name] for one in answered)
    low, high = binom.interval(0.95, len(answered), NOMINAL) if answered else (0, 0)
    return {
        "covered": share,
        "covered of those called identified": inside / len(answered) if answered else None,
        "exact interval of those, 95 % of studies": (
            [low / len(answered), high / len(answered)] if answered else None
        ),
        "answers": len(good),
        "misses, value too high and too low": misses,
        "mean error": mean,
        "standard error of it": float(error.std(ddof=1) / np.sqrt(len(good))) if len(good) > 1 else None,
        "scatter": float(error.std(ddof=1)) if len(good) > 1 else None,
        "mean error without the mesh correction": float((error - correction).mean()),
        "mean correction": float(correction.mean()),
        "mean sigma": float(sigma.mean()),
        "mean parts": {source: float(np.mean([p.get(source, 0.0) for p in parts])) for source in sources},
        "error over sigma, mean and standard deviation": [
            float((error / sigma).mean()),
            float((error / sigma).std(ddof=1)) if len(good) > 1 else None,
        ],
        "covered by force alone and outline alone": _routes(name, good),
        "covered by the profile likelihood alone": float(np.mean(within)) if within else None,
        "as wanted": {
            "covered 92 to 98 %": WANTED[0] <= share <= WANTED[1],
            "mean error below a quarter of sigma": abs(mean) < LARGEST_MEAN * float(sigma.mean()),
            "misses on both sides": not lopsided,
        },
    }


def _routes(name: str, good: Each) -> dict[str, float]:
    """How often the k = 2 interval of each channel contains the true value."""
    found = {}
    for route in ("force only", "shape only"):
        pairs = [(one["routes"][route][name], one["truth"][name]) for one in good if route in one["routes"]]
        if pairs:
            found[route] = float(
                np.mean([abs(value - true) <= 2.0 * sigma for (value, sigma), true in pairs])
            )
    return found


def table(said: dict[str, Any]) -> str:
    """One study as a Markdown table with one column for each parameter."""
    names = said["study"]["free"]
    n, (low, high) = said["experiments"], said["exact interval, 95 % of studies"]
    exact = f"{100 * low:.1f} to {100 * high:.1f} %"
    heads = [SYMBOLS[name] + (f" ({UNITS[name][1]})" if name in UNITS else "") for name in names]
    rows: list[tuple[str, list[str]]] = [
        (f"intervals that hold the truth, of {n}", [f"{100 * said[p]['covered']:.1f} %" for p in names]),
        (
            "what an exact interval does in 95 % of studies",
            [exact] * len(names),
        ),
        (
            f"of the {said.get('called identified', '–')} that are called identified",
            [_answered(said[p]) for p in names],
        ),
        ("misses: too high, too low", [_misses(said[p]) for p in names]),
    ]
    rows += [
        (words, [_shown(p, said[p][key]) for p in names])
        for words, key in (
            ("mean error", "mean error"),
            ("standard error of it", "standard error of it"),
            ("mean error without the mesh correction", "mean error without the mesh correction"),
            ("scatter of the answers", "scatter"),
            ("mean standard uncertainty", "mean sigma"),
        )
    ]
    sources = sorted({source for p in names for source in said[p]["mean parts"]})
    rows += [
        (f"of it: {source}", [_shown(p, said[p]["mean parts"].get(source, 0.0)) for p in names])
        for source in sources
    ]
    rows += [
        (f"covered by the {words} alone", [_route(said[p], route) for p in names])
        for words, route in (("force", "force only"), ("outline", "shape only"))
    ]
    lines = [f"| | {' | '.join(heads)} |", "| --- |" + " --- |" * len(names)]
    return "\n".join([*lines, *(f"| {words} | {' | '.join(cells)} |" for words, cells in rows)])


def _answered(one: dict[str, Any]) -> str:
    """Share of the answers that contain the true value, with the range that exact intervals give in 95 % of
    studies."""
    share = one.get("covered of those called identified")
    if share is None:
        return "–"
    low, high = one["exact interval of those, 95 % of studies"]
    return f"{100 * share:.1f} % ({100 * low:.1f} to {100 * high:.1f} %)"


def _misses(one: dict[str, Any]) -> str:
    misses = one["misses, value too high and too low"]
    return f"{misses['above']}, {misses['below']}"


def _route(one: dict[str, Any], route: str) -> str:
    share = one["covered by force alone and outline alone"].get(route)
    return "–" if share is None else f"{100 * share:.1f} %"


def _shown(name: str, value: float | None) -> str:
    if value is None:
        return "–"
    text = f"{value * UNITS.get(name, (1.0, ''))[0]:.2g}"
    return text.replace("-", "−")


if __name__ == "__main__":
    print_tables(table)
