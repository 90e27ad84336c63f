"""How often the intervals of a coverage study held the truth, and what chance allows of exact ones."""

from typing import Any

import numpy as np
from scipy.stats import binom, binomtest

from kolsky.inverse.result import Verdict

NOMINAL = 0.9545
"""Share that an interval of k = 2 holds of a normal distribution."""
WANTED = (0.92, 0.98)
"""Range of the share that a study of 200 should find."""
LARGEST_MEAN = 0.25
"""Largest mean error over the mean standard uncertainty that is wanted."""

ANSWERS = frozenset(verdict.value for verdict in Verdict if verdict.identified)
"""Verdicts that give a value as an answer."""

Each = list[dict[str, Any]]
"""Experiments, each the fields of `benchmarks.coverage.Found`."""


def summary(each: Each) -> dict[str, Any]:
    """Each parameter's coverage, errors and standard uncertainties; no answer holds nothing.

    Parameters
    ----------
    each
        The experiments.
    """
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
    """True if every verdict of an experiment is an answer, be it of one channel alone."""
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
    # Of misses that fall to either side alike, all on one side is chance once in 2^(n - 1).
    lopsided = binomtest(misses["above"], max(sum(misses.values()), 1)).pvalue < 0.05
    within = [  # an open end is NaN, which nothing is beyond
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
    """How often the k = 2 interval of a route holds the truth."""
    found = {}
    for route in ("force only", "shape only"):
        pairs = [(one["routes"][route][name], one["truth"][name]) for one in good if route in one["routes"]]
        if pairs:
            found[route] = float(
                np.mean([abs(value - true) <= 2.0 * sigma for (value, sigma), true in pairs])
            )
    return found
