"""The study of wrong inputs: evaluation of a job, and requirements for the committed table."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from kolsky.shot.inputs import causes
from kolsky.shot.load import load_shot
from populations.wrong_input_rows import BY_NAME, CURVE, PAIRS, RIGHT, ROWS, VOLTAGE
from populations.wrong_inputs import judged, summary, table

RESULTS = Path(__file__).parents[2] / "populations" / "results"
COMMITTED = [RESULTS / name for name in ("wrong_inputs.json", "wrong_inputs_felupe.json")]
ALARMS = 2  # right shots of 80 that may be named or not called identified


def said(row: str, *named: str, identified: bool = True, refused: str = "", **more: Any) -> dict[str, Any]:
    causes = [
        {"key": key, "alike": [], "named": True, "evidence": 50.0, "m": 1.1, "value": 0.5} for key in named
    ]
    return {
        "row": row, "refused": refused, "identified": identified, "causes": causes, "truth": 1.0,
        "value": 1.01, "sigma": 0.01, "curve_visible": 0.0, "seconds": 3.0, **more,
    }  # fmt: skip


def test_a_job_is_judged_by_the_place_of_the_right_cause() -> None:
    half = BY_NAME["sensitivity x 1/2"]
    assert judged(half, said(half.name, half.key, "specimen.length")) == "first"
    assert judged(half, said(half.name, "specimen.length", half.key)) == "second"
    assert (
        judged(half, said(half.name, "specimen.length", "flyer.time", half.key, identified=False)) == "other"
    )
    assert judged(half, said(half.name, identified=False)) == "none"
    assert judged(half, said(half.name, refused=f"shot.toml: {half.key} is too small")) == "refused"
    assert judged(half, said(half.name, refused="shot.toml: flyer.time")) == "other"
    assert judged(BY_NAME[VOLTAGE], said(VOLTAGE, refused="the voltage rises")) == "refused"
    density = BY_NAME["density -10 %"]
    assert judged(density, said(density.name, "force.sensitivity")) == "first"


def test_a_pair_is_first_if_both_inputs_are_among_the_first_three() -> None:
    pair = BY_NAME["length -1.5 %; sensitivity x 1/2"]
    length, gain, density = "specimen.length", "force.sensitivity", "specimen.density"
    assert judged(pair, said(pair.name, gain, density, length, identified=False)) == "first"
    assert judged(pair, said(pair.name, length, "flyer.time", density)) == "first"  # a twin of the gain
    assert judged(pair, said(pair.name, gain, density, "flyer.time", length)) == "second"
    assert judged(pair, said(pair.name, "flyer.time", length, identified=False)) == "second"
    assert judged(pair, said(pair.name, "flyer.time", identified=False)) == "other"
    assert judged(pair, said(pair.name, identified=False)) == "none"
    open_01 = RESULTS.parents[1] / "runs" / "open-01"
    right, wrong = load_shot(open_01), pair.wrong(open_01)
    assert wrong.specimen.length == pytest.approx(0.985 * right.specimen.length)
    assert np.ptp(wrong.force.history().force) == pytest.approx(2.0 * np.ptp(right.force.history().force))


def test_an_answer_is_confident_and_wrong_beyond_its_interval_and_a_percent() -> None:
    """The truth is 1: 1.01 is no error that matters, 1.03 with a sigma of 0.02 holds it, with 0.01 not."""
    half = BY_NAME["sensitivity x 1/2"]
    assert judged(half, said(half.name, value=1.0099, sigma=1e-4)) == "harmless"
    assert judged(half, said(half.name, value=1.03, sigma=0.02)) == "harmless"
    assert judged(half, said(half.name, value=1.03, sigma=0.01)) == "confident"
    assert judged(half, said(half.name, value=0.97, sigma=0.01)) == "confident"
    assert judged(half, said(half.name, "specimen.length", value=1.03, sigma=0.01)) == "other"


def test_a_summary_has_shares_of_what_matters() -> None:
    half = BY_NAME["sensitivity x 1/2"]
    wrong = [
        said(half.name, half.key),
        said(half.name, "specimen.length", half.key),
        said(half.name, identified=False),
        said(half.name, refused=half.key),
        said(half.name, value=1.0, sigma=0.01),  # harmless
        said(CURVE),  # no share of it
    ]
    right = [said(RIGHT), said(RIGHT, "specimen.length", value=1.021)]  # of 1 ± 0.02
    assert summary([*wrong, *right]) == {
        "wrong": 4, "first": 0.5, "first two": 0.75, "confident": 0, "harmless": 1, "right": 2, "alarms": 1,
        "inside": 1,
    }  # fmt: skip
    assert summary([said(half.name, value=1.5, sigma=0.01)])["confident"] == 1


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
    (row,) = table([said(half.name, half.key), said(half.name), said(half.name, refused=half.key)])
    assert row["ends"] == {"first": 1, "refused": 1, "harmless": 1}
    assert row["shots"] == 3
    assert row["errors"] == pytest.approx([0.01, 0.01])
    assert row["corrected errors"] == pytest.approx([0.1])


def test_there_are_thirty_kinds_of_wrong_inputs() -> None:
    assert len([row for row in ROWS if not row.name.startswith(RIGHT)]) >= 30
    assert len(BY_NAME) == len(ROWS) + len(PAIRS)
    keys = {c.key for c in causes()}
    assert all({row.key, *row.names, *row.second} - {""} <= keys for row in BY_NAME.values())


def test_the_committed_studies_name_the_right_cause() -> None:
    """Both seeds, each judged once, together: one shot more or less is 1.4 % of a single one."""
    each = [json.loads(path.read_text("utf-8"))["summary"] for path in COMMITTED]
    many = sum(found["wrong"] for found in each)
    for place, least in (("first", 0.85), ("first two", 0.95)):
        assert sum(found[place] * found["wrong"] for found in each) >= least * many
    assert all(found["confident"] == 0 and found["alarms"] <= ALARMS for found in each)


@pytest.mark.slow
def test_a_wrong_rate_of_the_camera_is_named_first_in_a_shot_by_another_program() -> None:
    """Times of all frames x 0.97, on the default meshes: a gain of the force explains nearly as much."""
    from kolsky.identification import identify
    from kolsky.inverse.settings import Numerics, Settings

    row = BY_NAME["frames x 0.97"]
    settings = Settings(numerics=Numerics(threads=1))
    found = identify(row.wrong(RESULTS.parents[1] / "runs" / "open-05"), settings)
    assert not found.estimates["stiffness_factor"].outcome.identified
    first = found.causes[0]
    assert first.named
    assert first.key == row.key
    # A tenth of the change: the meshes leave 2e-3. The declared inputs allow 2.5 % of m.
    assert first.value == pytest.approx(1.0 / 0.97, abs=3e-3)
    assert first.parameters["stiffness_factor"] == pytest.approx(1.12, rel=0.025)
