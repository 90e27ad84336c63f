"""What a study of the advice of a branch has found: counts with their exact intervals, and a table of them.

`python -m benchmarks.branch_advice_counts SUMMARY ...` prints the table of a `summary.json`.
"""

import json
import sys
from pathlib import Path
from typing import Any

from benchmarks.coverage_counts import ANSWERS, Each
from benchmarks.joint_coverage_counts import element_of, share
from kolsky.material.relaxation.rate_fit import SIGNIFICANT

KINDS = ("relaxing", "elastic")
ROWS = (
    ("recommended to try a branch", "advised"),
    ("by the linear test", "by the linear test"),
    ("by the search for a strong branch", "by the search"),
    ("nothing said, and called identified", "called identified"),
    ("nothing said, no answer either", "withheld"),
    ("refused", "refused"),
)


def summary(each: Each) -> dict[str, Any]:
    """Shots of each kind by what is said of them, and every shot."""
    return {"kinds": {kind: _kind([one for one in each if one["kind"] == kind]) for kind in KINDS},
            "each": list(each)}  # fmt: skip


def _kind(each: Each) -> dict[str, Any]:
    silent = [one for one in each if not one["advised"] and not one["error"]]
    linear = [one for one in each if one["advised"] and by_linear_test(one)]
    identified = sum(all(v in ANSWERS for v in one["verdicts"].values()) for one in silent)
    counts = {
        "advised": sum(one["advised"] for one in each),
        "by the linear test": len(linear),
        "by the search": sum(one["advised"] for one in each) - len(linear),
        "called identified": identified,
        "withheld": len(silent) - identified,
        "refused": sum(bool(one["error"]) for one in each),
    }
    return {"shots": len(each), **{name: share(count, len(each)) for name, count in counts.items()}}


def by_linear_test(one: dict[str, Any]) -> bool:
    """Whether the linear test has answered for a shot: then no branch is searched for."""
    return float(one["branch"].get("branch_probability", 1.0)) < SIGNIFICANT


def table(said: dict[str, Any]) -> str:
    """A study as Markdown: a column a kind of shot.

    Parameters
    ----------
    said
        A `summary.json`.
    """
    study = said["study"]
    meshes = " → ".join(f"{study[key][0]} × {study[key][1]}" for key in ("mesh", "refined_mesh"))
    truth = " × ".join(map(str, study["truth_mesh"]))
    shots = ", ".join(f"{said['kinds'][kind]['shots']} {kind}" for kind in KINDS)
    lines = [
        f"{shots} shots of seed {study['seed']} (meshes {meshes}; truth {truth}, {element_of(study)}, graded "
        f"{study['truth_grading']:g} to 1).",
        "",
        f"| | {' | '.join(f'{kind}' for kind in KINDS)} |",
        "| --- | --- | --- |",
    ]
    for words, key in ROWS:
        cells = " | ".join(_counted(said["kinds"][kind][key]) for kind in KINDS)
        lines.append(f"| {words} | {cells} |")
    return "\n".join(lines)


def _counted(one: dict[str, Any]) -> str:
    low, high = (100.0 * end for end in one["interval"])
    return f"{one['count']} of {one['of']} ({low:.0f} to {high:.0f} %)"


if __name__ == "__main__":
    for path in sys.argv[1:]:
        print(f"{table(json.loads(Path(path).read_text('utf-8')))}\n")
