"""Results of a study of branch recommendations: counts with exact intervals, and their table.

`python -m populations.branch_advice_counts SUMMARY ...` prints the table of a `summary.json`.
"""

from typing import Any

from kolsky.material.relaxation.rate_fit import SIGNIFICANT
from populations.coverage_counts import ANSWERS, Each
from populations.driver import print_tables
from populations.joint_coverage_counts import counted, element_of, share

TWINS = {"relaxing": False, "elastic": True}
"""Whether the material is elastic, by kind of shot."""
ROWS = (
    ("recommended to try a branch", "advised"),
    ("by the linear test", "by the linear test"),
    ("by the search for a strong branch", "by the search"),
    ("nothing said, and called identified", "called identified"),
    ("nothing said, no answer either", "withheld"),
    ("refused", "refused"),
)


def summary(each: Each) -> dict[str, Any]:
    """Numbers of shots of each kind by recommendation, and number of all shots."""
    return {"kinds": {kind: _kind([one for one in each if one["kind"] == kind]) for kind in TWINS},
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
    """Whether the linear test was sufficient for a shot. Then no branch was fitted."""
    return float(one["branch"].get("branch_probability", 1.0)) < SIGNIFICANT


def table(said: dict[str, Any]) -> str:
    """A study's `summary.json` as a Markdown table with one column for each kind of shot."""
    study = said["study"]
    meshes = " → ".join(f"{study[key][0]} × {study[key][1]}" for key in ("mesh", "refined_mesh"))
    truth = " × ".join(map(str, study["truth_mesh"]))
    shots = ", ".join(f"{said['kinds'][kind]['shots']} {kind}" for kind in TWINS)
    lines = [
        f"{shots} shots of seed {study['seed']} (meshes {meshes}; truth {truth}, {element_of(study)}, graded "
        f"{study['truth_grading']:g} to 1).",
        "",
        f"| | {' | '.join(f'{kind}' for kind in TWINS)} |",
        "| --- | --- | --- |",
    ]
    for words, key in ROWS:
        cells = " | ".join(counted(said["kinds"][kind][key]) for kind in TWINS)
        lines.append(f"| {words} | {cells} |")
    return "\n".join(lines)


if __name__ == "__main__":
    print_tables(table)
