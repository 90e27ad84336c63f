"""How often the intervals of a coverage study held the truth, and what chance allows of exact ones."""

from typing import Any

import numpy as np
from scipy.stats import binom

from kolsky.uncertainty.numerical import ONE_SIDED, ORDER

NOMINAL = 0.9545
"""Share that an interval of k = 2 holds of a normal distribution."""

Each = list[dict[str, Any]]
"""Experiments, each the fields of `benchmarks.coverage.Found`."""


def summary(each: Each, ratio: float) -> dict[str, Any]:
    """Each parameter's coverage, errors and standard uncertainties; no answer holds nothing.

    Parameters
    ----------
    each
        The experiments.
    ratio
        Elements across the radius of the refined mesh over those of the surrogate's.
    """
    n = len(each)
    low, high = binom.interval(0.95, n, NOMINAL)
    names = each[0]["truth"]
    rows = {name: _parameter(name, each, ratio) for name in names}
    outcomes = sorted({one["outcome"] for one in each})
    return {
        "experiments": n,
        "exact interval, 95 % of studies": [low / n, high / n],
        "outcomes": {text: sum(one["outcome"] == text for one in each) for text in outcomes},
        **rows,
    }


def joined(parts: list[dict[str, Any]]) -> dict[str, Any]:
    """Studies of other experiments of one kind as one.

    Raises
    ------
    ValueError
        If the parts differ in more than their rows, or overlap.
    """
    studies = [{key: value for key, value in part["study"].items() if key != "rows"} for part in parts]
    if any(study != studies[0] for study in studies):
        raise ValueError("the parts are not of one study")
    rows = [i for part in parts for i in range(*(part["study"]["rows"] or (0, part["study"]["experiments"])))]
    if len(set(rows)) < len(rows):
        raise ValueError("the parts overlap")
    each = [one for part in parts for one in part["each"]]
    seconds = {key: sum(part["seconds"][key] for part in parts) for key in parts[0]["seconds"]}
    ratio = studies[0]["refined_mesh"][0] / studies[0]["mesh"][0]
    head = {key: parts[0][key] for key in ("machine", "workers")}
    return {**head, "study": studies[0], "seconds": seconds, **summary(each, ratio), "each": each}


def _parameter(name: str, each: Each, ratio: float) -> dict[str, Any]:
    good = [one for one in each if np.isfinite(one["value"][name])]
    error = np.array([one["value"][name] - one["truth"][name] for one in good])
    sigma = np.array([one["sigma"][name] for one in good])
    shift = np.array([one["mesh_shift"][name] for one in good])
    parts = [one["parts"][name] for one in good]
    half = np.hypot(
        [one["sigma_noise"][name] for one in good], [0.5 * ONE_SIDED * part["mesh"] for part in parts]
    )
    sources = sorted({source for part in parts for source in part})
    within = [  # an open end is NaN, which nothing is beyond
        not (one["truth"][name] < one["profile"][name][0] or one["truth"][name] > one["profile"][name][1])
        for one in good
        if name in one["profile"]
    ]
    return {
        "covered": float((np.abs(error) <= 2.0 * sigma).sum()) / len(each),
        "answers": len(good),
        "mean error": float(error.mean()),
        "scatter": float(error.std(ddof=1)),
        "mean sigma": float(sigma.mean()),
        "mean sigma noise": _mean(one["sigma_noise"][name] for one in good),
        "mean sigma numerical": _mean(one["sigma_numerical"][name] for one in good),
        "mean parts": {source: _mean(part.get(source, 0.0) for part in parts) for source in sources},
        "error over sigma, mean and standard deviation": [
            float((error / sigma).mean()),
            float((error / sigma).std(ddof=1)),
        ],
        "mean shift between meshes": float(shift.mean()),
        "mean error less the estimated one of the mesh": float((error + shift / (ratio**ORDER - 1.0)).mean()),
        "covered with half the grid convergence index": float((np.abs(error) <= 2.0 * half).mean()),
        "covered by the profile likelihood alone": float(np.mean(within)) if within else None,
    }


def _mean(values: Any) -> float:
    return float(np.mean(list(values)))
