"""Limits chosen on one population of correct shots and tested once on another: numbers and table.

A search result is wrong if an estimate is more than `ASTRAY` standard uncertainties from the truth in
`truth.json`. The residuals of such a shot are not those of a correct answer. It is not used to choose a limit
and is counted separately.
"""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from kolsky.diagnosis.causes import EVIDENCE
from kolsky.diagnosis.fit_quality import LIMITS, SLOW_LIMITS
from kolsky.inverse.result import Identification
from populations.driver import counted, markdown, share

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
    return {
        "limits": rows,
        "population one": outcomes(one),
        "population two": outcomes(two),
    }


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
