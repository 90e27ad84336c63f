"""Pairs and points that do not belong: found against the cameras which the others agree on."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dic.arrays import FloatArray
from dic.calibration.bundle import HARDLY, adjust
from dic.calibration.checks import by_pair, posed
from dic.calibration.projection import View
from dic.calibration.rig_state import Fit, Rig, Undetermined, residuals
from dic.calibration.start import rms
from dic.calibration.views import only
from dic.robust import MAD

Z_PAIR, TIMES = 6.0, 2.0
"""A pair is bad if its rms residual lies this many robust standard deviations above the median of the pairs
and is this many times the median: the first alone would reject the worst of very even pictures, the second
alone the blurred ones of a mixed set."""
Z_POINT = 7.0
"""A point is dropped if it is off by more than this many robust standard deviations of its view."""
REWEIGHTED = 4
"""Rounds of reweighting before any pair is judged."""
LEAST_PAIRS = 4
"""With fewer pairs than this there is no majority to judge by."""


@dataclass(frozen=True)
class Verdicts:
    """Pairs and points kept and left out."""

    kept: list[View]
    """Views with the points used."""
    used: dict[tuple[int, int], NDArray[np.bool_]]
    """(pair, camera) -> which points of the view were used."""
    bad: dict[int, str]
    """Pair -> why it was left out."""


def solve_without_bad(
    rig: Rig, views: Sequence[View], columns: tuple[FloatArray, FloatArray], *, reject: bool
) -> tuple[Fit, Verdicts]:
    """The least squares of the pairs and points that agree.

    The first verdict is that of a robust solution (`_robust`). Then the worst pair is left out as long as it
    is bad; after each solution every pair that is out is tried
    again with nothing but its pose adjusted, and comes back if it fits. So one bad pair cannot take good
    ones with it, and the verdict on a pair never rests on a solution that it took part in spoiling.

    Parameters
    ----------
    rig, views
        The start, and all that was seen.
    columns
        What is adjusted first, and in the end (`free_columns`).
    reject
        False: keep all.
    """
    pairs = by_pair([s for s in views if s.pair in rig.poses])
    bad: dict[int, str] = {}
    if reject:
        first = {pair: rms(rig, views) for pair, views in pairs.items()}
        # The start is rough: only what is far beyond the rest is put aside now, and tried again below.
        limit = 10.0 * float(np.median(list(first.values()))) + 1.0
        bad = {pair: "" for pair, value in first.items() if value > limit}
    fit = _solve(rig, pairs, bad, columns[0])
    if reject and len(pairs) >= LEAST_PAIRS:
        fit, bad = _robust(fit, pairs, bad, columns[1])
    for _ in range(len(pairs)):
        fit = _solve(fit.rig, pairs, bad, columns[1])
        if not reject:
            break
        errors = {pair: _error(fit, views, pair in bad) for pair, views in pairs.items()}
        now = _judged(errors, bad)
        if set(now) == set(bad):
            bad = now
            break
        bad = now
    used = _points(fit, pairs, bad, reject)
    kept = [only(s, used[s.pair, s.camera]) for p, views in pairs.items() if p not in bad for s in views]
    fit = adjust(fit.rig, kept, columns[1], damping=HARDLY)
    poses = dict(fit.rig.poses)
    for pair in bad:
        poses[pair] = posed(fit.rig, pairs[pair]).rig.poses[pair]
    return Fit(
        Rig(fit.rig.cameras, poses), fit.covariance, fit.chi2, fit.freedom, fit.pose_covariance
    ), Verdicts(kept, used, bad)


def _solve(rig: Rig, pairs: dict[int, list[View]], bad: dict[int, str], columns: FloatArray) -> Fit:
    good = [s for pair, views in pairs.items() if pair not in bad for s in views]
    if not any(len(views) == 2 for pair, views in pairs.items() if pair not in bad):
        raise Undetermined("no pair in which both cameras saw the target agrees with the others")
    return adjust(rig, good, columns, tolerance=1e-5)


def _robust(
    fit: Fit, pairs: dict[int, list[View]], bad: dict[int, str], columns: FloatArray
) -> tuple[Fit, dict[int, str]]:
    """Cameras that bad pairs pull little at, and the pairs that do not fit them.

    Least squares again and again, each pair weighted with 1 / (1 + (e / m)²) for its rms residual e and the
    median m of all (Cauchy's weights): what does not fit loses its say, and then fits less.
    """
    weights = dict.fromkeys(pairs, 1.0)
    for _ in range(REWEIGHTED):
        views = [
            replace(s, sigma=s.sigma / np.sqrt(weights[pair]))
            for pair, views in pairs.items()
            if pair not in bad
            for s in views
        ]
        fit = adjust(fit.rig, views, columns, tolerance=1e-4)
        errors = {pair: _error(fit, views, pair in bad) for pair, views in pairs.items()}
        median = float(np.median(list(errors.values())))
        weights = {pair: 1.0 / (1.0 + (value / median) ** 2) for pair, value in errors.items()}
    limit = _limit(list(errors.values()))[0]
    return fit, {pair: "" for pair, value in errors.items() if value > limit}


def _limit(errors: Sequence[float]) -> tuple[float, float]:
    """Rms residual above which a pair is bad, and the median [px]."""
    median = float(np.median(errors))
    spread = MAD * float(np.median(np.abs(np.array(errors) - median)))
    return max(median + Z_PAIR * spread, TIMES * median), median


def _error(fit: Fit, views: list[View], out: bool) -> float:
    """Rms residual of a pair [px]; its pose is adjusted first if it took no part."""
    return rms(posed(fit.rig, views).rig if out else fit.rig, views)


def _judged(errors: dict[int, float], bad: dict[int, str]) -> dict[int, str]:
    """Bad pairs: those out that still do not fit, and the worst of those in if it does not."""
    if len(errors) < LEAST_PAIRS:
        return {}
    limit, median = _limit([value for pair, value in errors.items() if pair not in bad])

    def reason(value: float) -> str:
        return (
            f"rms residual {value:.3g} px with the cameras of the other pairs, median of these "
            f"{median:.3g} px, limit {limit:.3g} px"
        )

    now = {pair: reason(errors[pair]) for pair in bad if errors[pair] > limit}
    worst = max((pair for pair in errors if pair not in bad), key=lambda pair: errors[pair])
    if errors[worst] > limit:
        now[worst] = reason(errors[worst])
    return now


def _points(
    fit: Fit, pairs: dict[int, list[View]], bad: dict[int, str], reject: bool
) -> dict[tuple[int, int], NDArray[np.bool_]]:
    """Points of each view that are used."""
    used = {}
    for pair, views in pairs.items():
        for view in views:
            off = np.hypot(*residuals(fit.rig, view).T)
            # The median length of a plane Gaussian vector is 1.1774 of its coordinates' sigma.
            limit = Z_POINT * float(np.median(off)) / 1.1774
            near = off <= limit if reject else np.ones(len(off), dtype=bool)
            used[pair, view.camera] = near & (pair not in bad)
    return used
