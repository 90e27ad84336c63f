"""The study of wrong inputs: how a job is judged, and what the committed table must say."""

import json
from pathlib import Path
from typing import Any

import pytest

from populations.wrong_input_rows import CURVE, RIGHT, ROWS, VOLTAGE
from populations.wrong_inputs import judged, table

COMMITTED = Path(__file__).parents[2] / "populations" / "results" / "wrong_inputs.json"
ALARMS = 2
"""Right shots of 40 that may be named or not called identified."""
BY_NAME = {row.name: row for row in ROWS}


def said(row: str, *named: str, identified: bool = True, refused: str = "", **more: Any) -> dict[str, Any]:
    causes = [
        {"key": key, "alike": [], "named": True, "evidence": 50.0, "m": 1.1, "value": 0.5} for key in named
    ]
    return {
        "row": row,
        "refused": refused,
        "identified": identified,
        "causes": causes,
        "truth": 1.0,
        "value": 1.01,
        "curve_visible": 0.0,
        "seconds": 3.0,
        **more,
    }


def test_a_job_is_judged_by_what_was_said_first() -> None:
    half = BY_NAME["sensitivity x 1/2"]
    assert judged(half, said(half.name, half.key, "specimen.length")) == "named"
    assert judged(half, said(half.name, "specimen.length", half.key)) == "other named"
    assert judged(half, said(half.name, "specimen.length", identified=False)) == "not identified"
    assert judged(half, said(half.name)) == "silent"
    assert judged(half, said(half.name, refused="no")) == "refused"
    density = BY_NAME["density +5 %"]
    assert judged(density, said(density.name, "force.sensitivity")) == "named"


def test_a_right_shot_is_quiet_only_if_it_is_identified_and_nothing_named() -> None:
    right = BY_NAME[RIGHT]
    assert judged(right, said(RIGHT)) == "quiet"
    assert judged(right, said(RIGHT, "specimen.length")) == "alarm"
    assert judged(right, said(RIGHT, identified=False)) == "alarm"


def test_the_scale_of_the_curve_must_be_said_to_be_invisible() -> None:
    curve = BY_NAME[CURVE]
    assert judged(curve, said(CURVE)) == "said"
    assert judged(curve, said(CURVE, curve_visible=0.4)) == "silent"
    assert judged(curve, said(CURVE, curve_visible=None)) == "silent"


def test_a_table_counts_how_the_shots_ended() -> None:
    half = BY_NAME["sensitivity x 1/2"]
    (row,) = table([said(half.name, half.key), said(half.name), said(half.name, refused="no")])
    assert row["ends"] == {"named": 1, "refused": 1, "silent": 1}
    assert row["shots"] == 3
    assert row["errors"] == pytest.approx([0.01, 0.01])
    assert row["corrected errors"] == pytest.approx([0.1])


def test_the_committed_table_has_no_silent_row_and_few_alarms() -> None:
    if not COMMITTED.exists():
        pytest.skip("the study was not run yet")
    rows = {row["row"]: row for row in json.loads(COMMITTED.read_text("utf-8"))["rows"]}
    assert set(rows) == set(BY_NAME)
    for name, row in rows.items():
        ends = row["ends"]
        if name.startswith(RIGHT):
            assert row["shots"] >= 40
            assert ends.get("alarm", 0) <= ALARMS, name
        elif name == CURVE:
            assert ends == {"said": row["shots"]}
        else:
            assert not ends.get("silent"), name
            assert not ends.get("other named"), name
    assert rows[VOLTAGE]["ends"] == {"refused": rows[VOLTAGE]["shots"]}
