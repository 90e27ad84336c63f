"""Errors of random shots over their standard uncertainties.

`python -m populations.scatter --show FILE.json ...` prints their tables. Each file contains ``answers`` with
``values``, ``sigmas`` and ``truths`` by parameter. `python -m populations.answers` writes such files, e.g.
populations/results/right_second.json.
"""

import statistics
from collections.abc import Sequence
from typing import Any

from populations.driver import command, markdown


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
    rows = []
    for name in names:
        z = errors(answers, name)
        if z:
            inside = sum(abs(one) <= 2.0 for one in z)
            moments = (f"{statistics.mean(z):+.2f}", f"{statistics.pstdev(z):.2f}", f"{max(map(abs, z)):.2f}")
            rows.append((name, len(z), *moments, inside))
    return markdown(("parameter", "shots", "mean", "scatter", "largest", "inside k = 2"), rows)


if __name__ == "__main__":
    command(__doc__, out=False, table=lambda content: table(content["answers"])).parse_args()
