"""The study of the advice of a branch: counts by hand, and twins that differ in the branch alone."""

from pathlib import Path
from typing import Any

import pytest

from populations.branch_advice import place_of
from populations.branch_advice_counts import summary, table
from populations.joint_coverage import Study, truth


def shot(kind: str, number: int, *, advised: bool, verdict: str = "identified", **branch: float) -> Any:
    return {"kind": kind, "number": number, "advised": advised, "verdicts": {"poisson": verdict},
            "branch": branch, "error": ""}  # fmt: skip


UNEXPLAINED = "not explained by the model"
EACH = [
    shot("relaxing", 0, advised=True, verdict=UNEXPLAINED, branch_probability=0.002),
    shot("relaxing", 1, advised=True, verdict=UNEXPLAINED, branch_probability=0.2, branch_share=0.9),
    shot("relaxing", 2, advised=True, verdict=UNEXPLAINED, branch_share=0.9),
    shot("relaxing", 3, advised=False, verdict=UNEXPLAINED, branch_probability=0.2, branch_share=0.1),
    shot("relaxing", 4, advised=False),
    shot("elastic", 0, advised=False),
    {**shot("elastic", 1, advised=False), "verdicts": {}, "error": "no run completed"},
]


def test_counts_by_hand() -> None:
    kinds = summary(EACH)["kinds"]
    counts = {
        kind: {name: one["count"] for name, one in found.items() if name != "shots"}
        for kind, found in kinds.items()
    }
    assert counts["relaxing"] == {
        "advised": 3,
        "by the linear test": 1,
        "by the search": 2,
        "called identified": 1,
        "withheld": 1,
        "refused": 0,
    }
    assert counts["elastic"] == {
        "advised": 0,
        "by the linear test": 0,
        "by the search": 0,
        "called identified": 1,
        "withheld": 0,
        "refused": 1,
    }
    assert (kinds["relaxing"]["shots"], kinds["elastic"]["shots"]) == (5, 2)
    study = {
        "seed": 5,
        "mesh": [24, 32],
        "refined_mesh": [64, 86],
        "truth_mesh": [96, 129],
        "truth_grading": 5,
    }
    lines = table({**summary(EACH), "study": study}).splitlines()
    assert lines[0].startswith("5 relaxing, 2 elastic shots of seed 5 (meshes 24 × 32 → 64 × 86")
    assert lines[4] == "| recommended to try a branch | 3 of 5 (15 to 95 %) | 0 of 2 (0 to 84 %) |"


def test_twins_differ_in_the_branch_alone(tmp_path: Path) -> None:
    study = Study(seed=77)
    (relaxing, one), (elastic, other) = (place_of(study, tmp_path, k, 3) for k in ("relaxing", "elastic"))
    assert one != other
    assert relaxing.quantities.motion == elastic.quantities.motion
    assert relaxing.quantities.material == elastic.quantities.material
    (series,) = relaxing.quantities.relaxing
    assert series.instantaneous == pytest.approx(1.0 + truth(study, 3)["prony_strength_1"])
    assert not elastic.quantities.relaxing
