"""Thresholds of `kolsky.diagnosis.thresholds` from shots that are known to be right.

``python -m benchmarks.fit_thresholds FOLDER`` reads every ``identification.h5`` below a folder: results of
shots made with independent noise, mesh and element, whose inputs are as declared. With ``--identify`` it
first identifies every shot below it that has no result yet, so that a study that was cut off goes on.

Printed are the quantiles of what the verdicts are made of, and for each the threshold of a stated rate of
false alarms: the upper tolerance limit of the logarithm, taken as normal, that holds this share of all right
shots with 95 % confidence (Howe 1969), or the largest that was seen where that is more, times a margin for
shots unlike these. It prints also what the thresholds in use say of these shots: of a fresh population that
is their rate of false alarms.
"""

import argparse
import json
from collections import Counter
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import nct, norm

from kolsky.diagnosis.thresholds import ALONE, CONTRADICTION, LATE, LIMITS, SLOW_LIMITS
from kolsky.diagnosis.verdicts import leading_lag, routes_apart
from kolsky.identification import identify
from kolsky.inverse.forward import Numerics
from kolsky.inverse.result import Identification
from kolsky.inverse.settings import Settings
from kolsky.results.hdf5 import read_identification, write_identification
from kolsky.shot.load import load_shot

FALSE_ALARMS = 0.0125
"""Share of right shots that one figure may refuse: of the four together 2 in 40."""
CONFIDENCE = 0.95
"""That no more than this share is refused."""
MARGIN = 1.25
"""Factor on a threshold for shots unlike those of the population."""
FEWEST = 10
"""Results from which a threshold is derived."""
RESULT = "identification.h5"
QUANTILES = (0.5, 0.9, 0.95, 1.0)
"""Shares of the population up to which figures are printed."""


def figures(result: Identification) -> Iterator[tuple[str, float]]:
    """What the verdicts on a fit are made of, by name."""
    for channel in result.fit:
        yield f"{channel.channel}: residual over expected", channel.excess
        yield f"{channel.channel}: slow residual over expected", channel.slow_excess
        for name, share in channel.weight.items():
            yield f"{channel.channel}: share of the information on {name}", share
    for name in result.estimates:
        if result.route_difference is not None:
            yield f"routes apart in sigmas, {name}", routes_apart(result, name)
    for lag in result.clocks:
        yield f"lag of the {lag.recording} in sigmas", lag.significance
    leading = leading_lag(result.clocks)
    if leading is not None:
        yield "leading lag in sigmas", leading.significance


def threshold(values: Iterable[float]) -> float:
    """Threshold of a positive figure from its values of right shots.

    Raises
    ------
    ValueError
        If there are fewer than ten, or one is not positive and finite.
    """
    found = np.array(list(values), dtype=np.float64)
    if len(found) < FEWEST or not (np.isfinite(found).all() and (found > 0.0).all()):
        raise ValueError(
            f"{len(found)} values from {found.min():.4g} to {found.max():.4g}; at least {FEWEST} that are "
            "positive and finite are needed"
        )
    logs = np.log(found)
    limit = logs.mean() + tolerance_factor(len(logs)) * logs.std(ddof=1)
    return float(MARGIN * np.exp(max(limit, logs.max())))


def tolerance_factor(n: int) -> float:
    """Standard deviations above the mean of n normal values that hold 1 - `FALSE_ALARMS` of all of them."""
    quantile = norm.ppf(1.0 - FALSE_ALARMS)
    return float(nct.ppf(CONFIDENCE, n - 1, quantile * np.sqrt(n)) / np.sqrt(n))


def population(folder: Path) -> dict[str, Identification]:
    """Results below a folder by the name of their own, which is their shot's.

    Raises
    ------
    ValueError
        If there is none, or one has no goodness of fit.
    """
    found = {
        str(path.relative_to(folder)): read_identification(path) for path in sorted(folder.rglob("*.h5"))
    }
    if not found:
        raise ValueError(f"{folder}: no identification.h5 below it")
    bare = [name for name, result in found.items() if not result.fit]
    if bare:
        raise ValueError(f"{folder / bare[0]}: no goodness of fit is recorded in it; identify the shot again")
    return found


def identify_missing(folder: Path, *, workers: int, device: str) -> list[str]:
    """Identify the shots below a folder that have no result; returns what was refused, a line a shot."""
    shots = sorted(path.parent for path in folder.rglob("shot.toml"))
    missing = [shot for shot in shots if not (shot / "results" / RESULT).exists()]
    work = partial(identified, device=device)
    if workers == 1:
        said = list(map(work, missing))
    else:
        with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
            said = list(pool.map(work, missing))
    return [line for line in said if line]


def identified(shot: Path, *, device: str) -> str:
    """Identify one shot with the default settings and write its result; returns why not, else ""."""
    numerics = Numerics(device=device, threads=1 if device == "cpu" else None)
    try:
        result = identify(load_shot(shot), Settings(numerics=numerics))
    except ValueError as error:
        return f"{shot}: {error}"
    (shot / "results").mkdir(exist_ok=True)
    write_identification(shot / "results" / RESULT, result)
    return ""


def summary(results: dict[str, Identification]) -> dict[str, Any]:
    """Quantiles of every figure, thresholds from them, and what today's thresholds say of the population."""
    columns: dict[str, list[float]] = {}
    for result in results.values():
        for name, value in figures(result):
            columns.setdefault(name, []).append(value)
    excess = {name: values for name, values in columns.items() if "over expected" in name}
    outcomes = {
        name: sorted({e.outcome.value for e in result.estimates.values()}) for name, result in results.items()
    }
    return {
        "shots": len(results),
        "quantiles": {
            name: dict(zip(map(str, QUANTILES), np.quantile(values, QUANTILES).tolist(), strict=True))
            for name, values in columns.items()
        },
        "thresholds from these": {
            name: threshold(values) for name, values in excess.items() if len(values) > 9
        },
        "thresholds in use": {
            "limits": LIMITS,
            "slow limits": SLOW_LIMITS,
            "alone": ALONE,
            "contradiction": CONTRADICTION,
            "late": LATE,
        },
        "verdicts": Counter(verdict for said in outcomes.values() for verdict in said),
        "not identified": {
            name: said
            for name, said in outcomes.items()
            if not all(e.outcome.identified for e in results[name].estimates.values())
        },
    }


def main() -> None:
    """Print the summary of a population."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="holds the results, one identification.h5 a shot")
    parser.add_argument("--out", type=Path, help="JSON file")
    parser.add_argument("--identify", action="store_true", help="identify shots that have no result first")
    parser.add_argument("--workers", type=int, default=1, help="processes that identify")
    parser.add_argument("--device", default="cpu", help="cpu or a CUDA device")
    given = parser.parse_args()
    if given.identify:
        for line in identify_missing(given.folder, workers=given.workers, device=given.device):
            print("refused:", line)
    text = json.dumps(summary(population(given.folder)), indent=1)
    print(text)
    if given.out is not None:
        given.out.write_text(text + "\n", "utf-8")


if __name__ == "__main__":
    main()
