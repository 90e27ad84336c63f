"""False alarms of the rate-sensitivity test: `python -m populations.rate_sets ANSWERS.json ...`.

Each file is a `summary.json` of `python -m populations.coverage`: elastic shots of known stiffness factor,
each identified separately. The identified values are divided by their truth and multiplied by 1.12. All shots
then have the true value m = 1.12. Sets of five shots are drawn independently of m. Their rates span at least
the half decade that a slope requires. The study counts how often such a set is classified as rate sensitive.
It also adds a slope that the set should detect with a probability of 0.9, and counts how often it is
detected.

Sets share shots, so not all sets are independent. Every experiment has a separate quasi-static curve with
independent noise; the shots of a campaign share one curve.
"""

import argparse
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.studies.rates.comparison import slope_parts
from kolsky.studies.rates.records import COMMON_PARTS, COUNTED, MESH_PART, ONSET, PARAMETER
from kolsky.studies.rates.scatter import LEAST_SPAN, Slope, SlopeVerdict, slope
from populations.coverage_problem import drawn, stroke
from populations.driver import markdown, share, write

TRUE = 1.12
"""Stiffness factor of all shots after division by their truth [-]."""
SHOTS = 5
"""Number of shots of a set."""
CURVE = "material curve"
MOST_DRAWS = 10000
"""Largest number of draws of a set. After it the population's range of rates is considered too narrow."""


@dataclass(frozen=True)
class Answers:
    """The identified shots of a population."""

    rates: FloatArray
    """Nominal strain rates [1/s], shape [n]."""
    values: FloatArray
    """Stiffness factors over their true values, times `TRUE`, shape [n]."""
    own: FloatArray
    """Independent standard uncertainties, on the same scale, shape [n]."""
    curve: FloatArray
    """Standard uncertainties due to the curve's noise, on the same scale, shape [n]."""
    mesh: FloatArray
    """Standard uncertainties due to the mesh, on the same scale, shape [n]."""


def rate_of(number: int, seed: int) -> float:
    """Nominal strain rate of an experiment, Eq. (S.1) [1/s]."""
    setup, truth = drawn(number, seed)
    times = np.linspace(0.0, setup.end, 4001)
    strain = stroke(times, setup, truth) / setup.length
    first = int(np.argmax(strain >= ONSET))
    return float((strain[-1] - strain[first]) / (times[-1] - times[first]))


def read_answers(said: dict[str, Any]) -> Answers:
    """The identified shots of a `summary.json`."""
    seed, good = said["study"]["seed"], {verdict.value for verdict in COUNTED}
    rows = []
    for one in said["each"]:
        m, true = one["value"][PARAMETER], one["truth"][PARAMETER]
        if m is None or not np.isfinite(m) or not set(one["outcome"].split("; ")) <= good:
            continue
        parts, scale = one["parts"][PARAMETER], TRUE / true
        shared = {*COMMON_PARTS, "mesh"}
        own = np.sqrt(sum(part**2 for name, part in parts.items() if name not in shared))
        rows.append(
            (
                rate_of(one["number"], seed),
                *(scale * value for value in (m, own, parts.get(CURVE, 0.0), parts.get("mesh", 0.0))),
            )
        )
    return Answers(*np.array(rows).T)


def set_of(answers: Answers, rng: np.random.Generator) -> list[int]:
    """Indices of five shots whose rates span at least the range that a slope requires."""
    for _ in range(MOST_DRAWS):
        chosen = rng.choice(len(answers.rates), SHOTS, replace=False)
        if np.ptp(np.log10(answers.rates[chosen])) >= LEAST_SPAN:
            return chosen.tolist()
    raise ValueError(f"no {SHOTS} of {len(answers.rates)} shots span {LEAST_SPAN:g} decade")


def slope_of(answers: Answers, chosen: Sequence[int], planted: float = 0.0) -> Slope:
    """The slope as in `kolsky rate`, with a known slope `planted` [1/decade] added to the shots."""
    use = list(chosen)
    rates = answers.rates[use]
    x = np.log10(rates) - np.log10(rates).mean()
    parts = {(CURVE, str(i)): row for i, row in enumerate(np.diag(answers.curve[use]))}
    parts[MESH_PART, "one mesh"] = answers.mesh[use]
    values = answers.values[use] + planted * x
    common = slope_parts(parts, rates)
    return slope(rates, np.zeros(SHOTS), values, answers.own[use], common=common)


def counts(answers: Answers, *, sets: int, seed: int) -> dict[str, Any]:
    """Numbers of false alarms and of detected slopes over some sets."""
    rng = np.random.default_rng(seed)
    alarms = found = refused = 0
    sizes = []
    for _ in range(sets):
        chosen = set_of(answers, rng)
        flat = slope_of(answers, chosen)
        if flat.fit is None or flat.verdict is SlopeVerdict.REFUSED:
            refused += 1
            continue
        size = flat.fit.noticeable(1)
        alarms += flat.verdict is SlopeVerdict.SENSITIVE
        found += slope_of(answers, chosen, size).verdict is SlopeVerdict.SENSITIVE
        sizes.append(size)
    judged = sets - refused
    return {
        "shots": len(answers.rates),
        "sets": sets,
        "refused": refused,
        "false alarms": alarms,
        "share": alarms / judged,
        "interval": share(alarms, judged)["interval"],
        "planted slopes found": found / judged,
        "would notice, median per decade": float(np.median(sizes)),
        "would notice, 90 % of sets": float(np.quantile(sizes, 0.9)),
    }


def table(rows: dict[str, dict[str, Any]]) -> str:
    """The counts as a Markdown table with one row for each population."""
    heads = ("population", "shots", "sets", "refused", "false alarms", "planted found")
    cells = []
    for name, row in rows.items():
        low, high = (100.0 * end for end in row["interval"])
        alarms = f"{row['false alarms']} ({low:.1f} to {high:.1f} %)"
        found, size = row["planted slopes found"], row["would notice, median per decade"]
        counts = (row["shots"], row["sets"], row["refused"], alarms)
        cells.append((name, *counts, f"{100.0 * found:.0f} %", f"{size:.2g}"))
    return markdown((*heads, "would notice per decade"), cells)


def main() -> None:
    """Count the alarms of each file and print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("files", type=Path, nargs="+", metavar="ANSWERS.json")
    parser.add_argument("--sets", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1, help="of the sets")
    parser.add_argument("--out", type=Path, help="file of the counts")
    given = parser.parse_args()
    rows = {}
    for path in given.files:
        said = json.loads(path.read_text("utf-8"))
        name = path.parent.name if path.stem == "summary" else path.stem
        rows[name] = counts(read_answers(said), sets=given.sets, seed=given.seed)
    print(table(rows))
    if given.out is not None:
        write(given.out, rows, indent=1)


if __name__ == "__main__":
    main()
