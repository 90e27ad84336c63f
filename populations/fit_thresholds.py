"""Thresholds of `kolsky.diagnosis.fit_quality` from shots with correct inputs.

``python -m populations.fit_thresholds ONE --judge TWO`` reads every ``identification.h5`` below two folders.
They are results of synthetic shots with independent noise, mesh and element and with correct declared inputs.
The limits are chosen on the shots of ONE and tested on those of TWO. Without ``--judge`` they are only
chosen. With ``--identify`` every shot without a result is identified first, so an interrupted study can be
continued.

The limit of a figure follows from a given rate of false alarms. The logarithm of the figure is assumed
normal. The limit is its upper tolerance limit: with 95 % confidence the remaining share of all correct shots
is below it (Howe 1969). If the largest observed value is higher, this value is used. The result is multiplied
by a margin for different shots. Evidence is zero on many correct shots; its limit is the largest value times
the margin. The table gives the number of shots of TWO above each limit, and above the limit in use, with the
95 % interval of the share. ``--out`` stores it with the quantiles of all figures that the verdicts use.
"""

import json
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import nct, norm

from kolsky.diagnosis.causes import EVIDENCE
from kolsky.diagnosis.fit_quality import ALONE, CONTRADICTION, LIMITS, SLOW_LIMITS, leading_lag, routes_apart
from kolsky.identification import identify
from kolsky.inverse.result import LATE, Identification
from kolsky.inverse.settings import Numerics, Settings
from kolsky.results.hdf5 import read_identification, write_identification
from kolsky.shot.load import load_shot
from populations.driver import command, counted, markdown, results, share, write

FALSE_ALARMS = 0.0125
"""Share of correct shots that one figure may reject: 2 in 40 for the four together."""
CONFIDENCE = 0.95
"""Confidence that no more than this share is rejected."""
MARGIN = 1.25
"""Factor on a threshold for shots that differ from those of the population."""
FEWEST = 10
"""Smallest number of results from which a threshold is derived."""
RESULT = "identification.h5"
QUANTILES = (0.5, 0.9, 0.95, 1.0)
"""Quantiles of the population that are printed."""


ASTRAY = 6.0
"""A search result is wrong if its distance from the truth exceeds this number of standard uncertainties."""
TRUE = {"stiffness_factor": "m", "poisson": "nu", "damping": "beta_s"}
"""Keys of truth.json by parameter."""
STRONGEST = "strongest evidence of a cause"
IN_USE = {
    **{f"{channel}: residual over expected": limit for channel, limit in LIMITS.items()},
    **{f"{channel}: slow residual over expected": limit for channel, limit in SLOW_LIMITS.items()},
    STRONGEST: EVIDENCE,
}
"""Limits in use, by figure."""


@dataclass(frozen=True)
class RightShot:
    """One correct shot and its results."""

    name: str
    result: Identification
    truth: Mapping[str, float]
    """The true values by parameter; empty if unknown."""

    @property
    def astray(self) -> bool:
        """True if the search did not end at the truth."""
        return any(
            abs(e.value - self.truth[name]) > ASTRAY * e.sigma
            for name, e in self.result.estimates.items()
            if name in self.truth
        )

    @property
    def answered(self) -> bool:
        """True if the verdict on every parameter is identified."""
        return all(e.outcome.identified for e in self.result.estimates.values())

    @property
    def named(self) -> tuple[str, ...]:
        """The reported causes, although there is no cause."""
        return tuple(cause.key for cause in self.result.causes if cause.named)


def strongest(result: Identification) -> float:
    """Evidence of the strongest cause outside its declared uncertainty [-]; 0 if there is none."""
    return max((cause.evidence for cause in result.causes if not cause.within), default=0.0)


def limited(result: Identification) -> dict[str, float]:
    """The figures that have a limit, by name."""
    found = {STRONGEST: strongest(result)}
    for channel in result.fit:
        found[f"{channel.channel}: residual over expected"] = channel.excess
        found[f"{channel.channel}: slow residual over expected"] = channel.slow_excess
    return found


def truth(result: Path) -> dict[str, float]:
    """True values of the shot of a result in SHOT/results, by parameter; empty without truth.json."""
    place = result.parent.parent / "truth.json"
    if not place.exists():
        return {}
    said = json.loads(place.read_text("utf-8"))
    return {name: float(said[key]) for name, key in TRUE.items() if said.get(key) is not None}


def chosen(
    one: list[RightShot], two: list[RightShot], limit: Callable[[str, list[float]], float]
) -> dict[str, Any]:
    """Limits from population one, and false alarms on population two of these limits and of the limits in
    use. Population two may be empty. ``limit`` is a function of a figure's name and its values for correct
    shots."""
    found, judged = [s for s in one if not s.astray], [s for s in two if not s.astray]
    rows = {}
    for name, used in IN_USE.items():
        first = [limited(s.result)[name] for s in found if name in limited(s.result)]
        second = [limited(s.result)[name] for s in judged if name in limited(s.result)]
        new = limit(name, first)
        rows[name] = {
            "in use": used,
            "chosen": new,
            "shots of one": len(first),
            "largest of one": max(first),
            "shots of two": len(second),
            "largest of two": max(second, default=None),
            "of two above chosen": share(sum(value > new for value in second), len(second)),
            "of two above in use": share(sum(value > used for value in second), len(second)),
        }
    return {"limits": rows, "population one": outcomes(one), "population two": outcomes(two)}


def outcomes(shots: list[RightShot]) -> dict[str, Any]:
    """Counts of the outcomes of a population, with the limits in use at the time of identification."""
    right = [s for s in shots if not s.astray]
    return {
        "shots": len(shots),
        "search ended elsewhere": sorted(s.name for s in shots if s.astray),
        "not identified": share(sum(not s.answered for s in right), len(right)),
        "causes named": {s.name: list(s.named) for s in right if s.named},
    }


def table(said: dict[str, Any]) -> str:
    """The limits as a Markdown table, and the counts in two sentences."""
    heads = ["figure", "in use", "chosen on one", "largest of one", "largest of two"]
    heads += ["of two above in use", "of two above chosen"]
    rows = []
    for name, row in said["limits"].items():
        cells = [f"{row['in use']:.3g}", f"{row['chosen']:.3g}", f"{row['largest of one']:.3g}"]
        cells.append("–" if row["largest of two"] is None else f"{row['largest of two']:.3g}")
        cells += [counted(row[key], 1) for key in ("of two above in use", "of two above chosen")]
        rows.append((name, *cells))
    lines = [markdown(heads, rows)]
    for which in ("population one", "population two"):
        one = said[which]
        if one["shots"]:
            elsewhere = one["search ended elsewhere"]
            lines.append(
                f"\n{which}: {one['shots']} shots; the search of {len(elsewhere)} ended elsewhere"
                f"{' (' + ', '.join(elsewhere) + ')' if elsewhere else ''}; of the others not identified "
                f"{counted(one['not identified'], 1)}, a cause named on {len(one['causes named'])}"
            )
    return "\n".join(lines)


def figures(result: Identification) -> Iterator[tuple[str, float]]:
    """Figures on which the verdicts on a fit are based, by name."""
    for channel in result.fit:
        yield f"{channel.channel}: residual over expected", channel.excess
        yield f"{channel.channel}: slow residual over expected", channel.slow_excess
        for name, weight in channel.weight.items():
            yield f"{channel.channel}: share of the information on {name}", weight
    for name in result.estimates:
        if result.route_difference is not None:
            yield f"routes apart in sigmas, {name}", routes_apart(result, name)
    for lag in result.clocks:
        yield f"lag of the {lag.recording} in sigmas", lag.significance
    leading = leading_lag(result.clocks)
    if leading is not None:
        yield "leading lag in sigmas", leading.significance


def threshold(values: Iterable[float]) -> float:
    """Threshold of a positive figure from its values for correct shots. ValueError for fewer than `FEWEST`
    values, or a value that is not positive and finite."""
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
    """Factor k for which mean + k standard deviations of n normal values exceeds a share 1 - `FALSE_ALARMS`
    of the distribution with confidence `CONFIDENCE`."""
    quantile = norm.ppf(1.0 - FALSE_ALARMS)
    return float(nct.ppf(CONFIDENCE, n - 1, quantile * np.sqrt(n)) / np.sqrt(n))


def population(folder: Path) -> list[RightShot]:
    """Results below a folder, named by their paths. ValueError if there is none, or if one has no goodness of
    fit."""
    places = sorted(folder.rglob(RESULT))
    if not places:
        raise ValueError(f"{folder}: no {RESULT} below it; identify its shots with --identify")
    found = []
    for place in places:
        result = read_identification(place)
        if not result.fit:
            raise ValueError(f"{place}: no goodness of fit is recorded in it; identify the shot again")
        found.append(RightShot(str(place.relative_to(folder)), result, truth(place)))
    return found


def limit(name: str, values: list[float]) -> float:
    """Limit of a figure from its values for correct shots; see the module's docstring."""
    if name != STRONGEST:
        return threshold(values)
    if len(values) < FEWEST:
        raise ValueError(f"{len(values)} shots; at least {FEWEST} are needed")
    return MARGIN * max(values)


def identify_missing(folder: Path, *, workers: int, device: str) -> list[str]:
    """Identify the shots below a folder that have no result. Returns one line for each rejected shot."""
    shots = sorted(path.parent for path in folder.rglob("shot.toml"))
    missing = [shot for shot in shots if not (shot / "results" / RESULT).exists()]
    lines = results(identified, [(shot, device) for shot in missing], workers)
    refused = []
    for number, line in enumerate(lines, start=1):
        print(f"{number}/{len(missing)} {line or 'identified'}", flush=True)
        refused += [line] if line else []
    return refused


def identified(shot: Path, device: str) -> str:
    """Identify one shot with the default settings and write its result; returns the error's text, or ""."""
    numerics = Numerics(device=device, threads=1 if device == "cpu" else None)
    try:
        result = identify(load_shot(shot), Settings(numerics=numerics))
    except ValueError as error:
        return f"{shot}: {error}"
    (shot / "results").mkdir(exist_ok=True)
    write_identification(shot / "results" / RESULT, result)
    return ""


def summary(shots: list[RightShot]) -> dict[str, Any]:
    """Quantiles of every figure of the verdicts, and counts of the outcomes."""
    columns: dict[str, list[float]] = {}
    for shot in shots:
        for name, value in figures(shot.result):
            columns.setdefault(name, []).append(value)
    outcomes = {s.name: sorted({e.outcome.value for e in s.result.estimates.values()}) for s in shots}
    return {
        "shots": len(shots),
        "quantiles": {
            name: dict(zip(map(str, QUANTILES), np.quantile(values, QUANTILES).tolist(), strict=True))
            for name, values in columns.items()
        },
        "other thresholds in use": {"alone": ALONE, "contradiction": CONTRADICTION, "late": LATE},
        "verdicts": Counter(verdict for said in outcomes.values() for verdict in said),
        "not identified": {s.name: outcomes[s.name] for s in shots if not s.answered},
    }


def main() -> None:
    """Choose the limits on one population, test them on the other, print the table."""
    parser = command(__doc__, out=False)
    parser.add_argument("folder", type=Path, help="population one: the limits are chosen on it")
    parser.add_argument("--judge", type=Path, help="population two: the limits are judged on it")
    parser.add_argument("--out", type=Path, help="JSON file")
    parser.add_argument("--identify", action="store_true", help="identify shots that have no result first")
    given = parser.parse_args()
    folders = [folder for folder in (given.folder, given.judge) if folder is not None]
    refused = {}
    for folder in folders if given.identify else ():
        refused[str(folder)] = identify_missing(folder, workers=given.workers, device=given.device)
    one, *rest = (population(folder) for folder in folders)
    two = rest[0] if rest else []
    said = {
        **chosen(one, two, limit),
        "refused": refused,
        "figures of one": summary(one),
        "figures of two": summary(two) if two else None,
    }
    print(table(said))
    for folder, lines in refused.items():
        for line in lines:
            print(f"refused in {folder}: {line}")
    if given.out is not None:
        write(given.out, said, indent=1)


if __name__ == "__main__":
    main()
