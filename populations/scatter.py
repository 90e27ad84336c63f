"""Errors of random shots over their standard uncertainties: `python -m populations.scatter FILE.json ...`.

Each file contains ``answers`` with ``values``, ``sigmas`` and ``truths`` by parameter. `python -m
populations.answers` writes such files, e.g. populations/results/right_second.json.
"""

import statistics
from collections.abc import Sequence
from typing import Any

from populations.driver import print_tables


def errors(answers: Sequence[dict[str, Any]], name: str) -> list[float]:
    """(Value - truth) / sigma of every answer that has the parameter [-]."""
    return [
        (one["values"][name] - one["truths"][name]) / one["sigmas"][name]
        for one in answers
        if name in one["values"] and name in one["truths"]
    ]


def table(answers: Sequence[dict[str, Any]]) -> str:
    """Mean, scatter and maximum of the errors, and the number within k = 2, with one row for each
    parameter."""
    names = dict.fromkeys(name for one in answers for name in one["values"])
    lines = [
        "| parameter | shots | mean | scatter | largest | inside k = 2 |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for name in names:
        z = errors(answers, name)
        if z:
            inside = sum(abs(one) <= 2.0 for one in z)
            row = f"{statistics.mean(z):+.2f} | {statistics.pstdev(z):.2f} | {max(map(abs, z)):.2f}"
            lines.append(f"| {name} | {len(z)} | {row} | {inside} |")
    return "\n".join(lines)


if __name__ == "__main__":
    print_tables(lambda content: table(content["answers"]))
