"""Studies of coverage as tables of the documentation: `python -m benchmarks.coverage_table SUMMARY ...`."""

import json
import sys
from pathlib import Path
from typing import Any

UNITS = {"damping": (1e6, "µs")}
"""Factor and unit of what is not shown as it is."""
SYMBOLS = {"stiffness_factor": "$m$", "poisson": "$\\nu$", "damping": "$\\beta$", "friction": "$f$"}


def table(said: dict[str, Any]) -> str:
    """One study as a Markdown table, a column a parameter."""
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
    """Share of the answers that hold the truth, with what an exact interval does in 95 % of studies."""
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
    for path in sys.argv[1:]:
        print(f"{table(json.loads(Path(path).read_text()))}\n")
