"""The study of random shots: categories of answers, remedies, and stored answers."""

import json
import os
import sys
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

from dic.processes import cores
from kolsky.base.errors import InputError
from kolsky.base.process import WORKER
from populations import forty_shots
from populations.forty import SPEC, attempts, expected_beyond, kept_answers, series_of, spread, write
from populations.forty_cures import CURES, all_regions, flyer_region, true_inputs, with_subset
from populations.forty_shots import (
    Answer,
    Study,
    cured_copy,
    cures_for,
    keep_to,
    one,
    said_on_purpose,
    shares,
)

RIGHT = Answer("a", 1.2, 1.2 * 1.009, 0.005, "identified", True, "", 1.0, 2.0)


def test_what_an_answer_counts_as() -> None:
    """1 % of the truth is right, beyond three standard uncertainties it is confidently wrong."""
    assert RIGHT.kind == "right"
    assert replace(RIGHT, value=1.2 * 0.989).kind == "answered, beyond 1 %"
    assert replace(RIGHT, sigma=0.0037).kind == "right"  # 0.0108 off: 2.92 of them
    assert replace(RIGHT, sigma=0.0035).kind == "confidently wrong"  # 3.09 of them
    assert replace(RIGHT, answered=False).kind == "refused"
    assert (
        replace(RIGHT, value=None, sigma=None, answered=False, verdict="fault").kind == "stopped by a fault"
    )
    refused = replace(RIGHT, answered=False)
    assert refused.end is refused
    assert replace(refused, cured=[RIGHT]).end is RIGHT


def test_a_fault_is_no_refusal() -> None:
    with pytest.raises(ValueError, match="no hold") as meant:
        raise ValueError("no hold")
    with pytest.raises(ValueError, match="invalid literal") as accident:
        int("x")
    assert said_on_purpose(meant.value)
    assert not said_on_purpose(accident.value)
    assert said_on_purpose(InputError("shot.toml", "is missing"))


def test_an_answer_is_kept_and_read_back(tmp_path: Path) -> None:
    kept = replace(RIGHT, answered=False, cured=[replace(RIGHT, cure="larger subsets")])
    (tmp_path / "a.json").write_text(json.dumps(asdict(kept)), encoding="utf-8")
    assert one(Study(spec="no.toml", out=str(tmp_path)), "a") == kept


def test_cures_change_the_shot_file_alone(tmp_path: Path) -> None:
    """A flyer that comes from above ends 3 mm under the specimen's face at rest, seen head-on at 10 px/mm on
    the axis and 10.8 px/mm on its front, 7.5 mm nearer."""
    shot = tmp_path / "shot"
    (shot / "results").mkdir(parents=True)
    (shot / "shot.toml").write_text("[dic]\nsubset = 21\n", encoding="utf-8")
    (shot / "frames.csv").write_text("frame\n0\n1\n2\n", encoding="utf-8")
    camera = {
        "K": [[1000.0, 0.0, 64.0], [0.0, 1000.0, 64.0], [0.0, 0.0, 1.0]],
        "R": [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]],
        "t": [0.0, 0.0, 0.1],
        "crop_offset": [10, 20],
    }
    answer = {"m": 1.0, "cameras": [camera], "specification": {"cameras": {"flyer_side": "up"}}}
    (shot / "truth.json").write_text(json.dumps(answer), encoding="utf-8")
    np.savez(shot / "truth_surface.npz", d=[0.0, 3e-3])
    text = flyer_region("[dic]\nsubset = 21\n", shot)
    # Face at y = 3.5 mm: row 64 - 37.8 - 20 = 6.2 in front, and 4 px clear of it: no 8 px of height.
    assert text is None
    camera["crop_offset"] = [10, 0]
    (shot / "truth.json").write_text(json.dumps(answer), encoding="utf-8")
    text = flyer_region("[dic]\nsubset = 21\n", shot)
    flyer = "flyer = { x = [4.0, 123.0], y = [4.0, 22.2], frame = 2 }"
    assert text == f"[dic]\nsubset = 21\n{flyer}\n"
    # The specimen's ends: -1 and 64, on the axis of the camera, where nearer places are in the same row.
    specimen = "specimen = { x = [4.0, 123.0], y = [4.0, 60.0], frame = 0 }"
    edge = "transmission_edge = [54.0, 64.0]"
    text = all_regions("[dic]\nsubset = 21\n", shot)
    assert text == f"[dic]\nsubset = 21\n{specimen}\n{flyer}\n{edge}\n"
    assert all_regions(text, shot) is None
    camera["K"][1][1] = -1000.0  # the other way up: flyer below row 101.8, specimen between 64 and 129
    answer["specification"]["cameras"]["flyer_side"] = "down"
    (shot / "truth.json").write_text(json.dumps(answer), encoding="utf-8")
    text = all_regions("[dic]\nsubset = 21\n", shot)
    assert text is not None
    assert "specimen = { x = [4.0, 123.0], y = [68.0, 123.0], frame = 0 }" in text
    assert "flyer = { x = [4.0, 123.0], y = [105.8, 123.0], frame = 2 }" in text
    camera["K"][1][1], camera["t"][1], camera["crop_offset"] = 1000.0, -0.01, [10, -100]
    answer["specification"]["cameras"]["flyer_side"] = "up"
    (shot / "truth.json").write_text(json.dumps(answer), encoding="utf-8")
    text = all_regions("[dic]\nsubset = 21\n", shot)
    # From 10 mm below, the platen's rim in row 164 - 10 / 0.0925 hides the end in row 164 - 10 / 0.09525.
    assert text is not None
    assert "transmission_edge = [54.0, 55.9]" in text
    assert "specimen = { x = [4.0, 123.0], y = [4.0, 51.9], frame = 0 }" in text
    assert cured_copy(shot, tmp_path / "copy", with_subset(1.4))
    assert "subset = 29" in (tmp_path / "copy" / "shot.toml").read_text("utf-8")
    assert "subset = 21" in (shot / "shot.toml").read_text("utf-8")
    assert not (tmp_path / "copy" / "results").exists()


def test_inputs_are_declared_as_they_are(tmp_path: Path) -> None:
    """The specimen's own, and the sensitivity of the transmitted force."""
    q = {
        "specimen": {"diameter": "8.8 mm", "length": "5.8 mm", "density": "1043 kg/m^3"},
        "transmitted": {"sensitivity": "0.01 V/N"},
    }
    (tmp_path / "truth.json").write_text(json.dumps({"specification": q}), encoding="utf-8")
    rest = '[incident_force]\nsensitivity = "0.001 V/N"\n[calibration.target]\ndiameter = "0.58 mm"\n'
    said = '[specimen]\ndiameter = "8.9 mm"\nlength = "5.9 mm"\ndensity = "1044 kg/m^3"\n'
    is_so = '[specimen]\ndiameter = "8.8 mm"\nlength = "5.8 mm"\ndensity = "1043 kg/m^3"\n'
    declared = f'{said}[force]\nsensitivity = "0.011 V/N"\n{rest}'
    assert true_inputs(declared, tmp_path) == f'{is_so}[force]\nsensitivity = "0.01 V/N"\n{rest}'
    with pytest.raises(ValueError, match=r"no table \[force\]"):
        true_inputs(said, tmp_path)


def test_a_refused_answer_is_searched_with_a_finer_mesh(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where the pictures gave a value that was withheld; where they did not, no mesh helps."""
    refused = replace(RIGHT, answered=False)
    assert cures_for(refused) == ["a finer mesh", *CURES]
    assert cures_for(replace(refused, value=None)) == list(CURES)
    (tmp_path / "a.json").write_text(json.dumps(asdict(refused)), encoding="utf-8")
    asked: list[tuple[Path, tuple[int, int]]] = []

    def attempt(study: Study, name: str, folder: Path, cure: str = "") -> Answer:
        asked.append((folder, study.mesh))
        return replace(RIGHT, cure=cure)

    monkeypatch.setattr(forty_shots, "attempt", attempt)
    assert one(Study(spec="no.toml", out=str(tmp_path)), "a").end.cure == "a finer mesh"
    assert asked == [(tmp_path / "shots" / "a", (32, 43))]


def test_errors_over_their_uncertainties() -> None:
    """z of 1 and -3 have a root mean square of the root of 5; what is not answered has none."""
    answers = [
        replace(RIGHT, truth=1.0, value=1.01, sigma=0.01),
        replace(RIGHT, truth=1.0, value=0.97, sigma=0.01),
        replace(RIGHT, truth=1.0, value=2.0, sigma=0.01, answered=False),
        replace(RIGHT, value=None, sigma=None, answered=False),
    ]
    found = spread(answers)
    assert (found["scatter"], found["largest"]) == pytest.approx((5.0**0.5, 3.0))
    # One of both is at most 2; 1 % and 3 % of m have the median of 2 %.
    assert found["inside k = 2"] == 1
    assert found["median error"] == pytest.approx(0.02)
    assert found["mean uncertainty"] == pytest.approx(0.01)
    wide = spread([replace(answers[0], truth=2.0, value=2.02), replace(answers[0], sigma=0.03)])
    assert wide["mean uncertainty"] == pytest.approx(0.0175)  # 0.5 % of 2 and 3 % of 1
    # Of two with a standard uncertainty of 1 % a third each lies beyond it, of one with 0.5 % a 22nd.
    assert found["expected beyond 1 %"] == pytest.approx(2 * 0.3173, abs=1e-4)
    assert expected_beyond([replace(answers[0], truth=2.0)]) == pytest.approx(0.0455, abs=1e-4)
    assert set(spread(answers[2:]).values()) == {None}


def test_a_seed_draws_another_population() -> None:
    own, same, other = (series_of(Study(spec=str(SPEC), out="out", seed=seed)) for seed in (None, 2012, 7))
    assert own.shot(3).quantities == same.shot(3).quantities
    assert own.shot(3).quantities.specimen != other.shot(3).quantities.specimen
    assert other.declared.seed == 7


def test_an_answer_is_kept_before_its_cures(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A study that is stopped within the first cure goes on with that cure, not with the shot."""
    shot = tmp_path / "shots" / "a"
    shot.mkdir(parents=True)
    (shot / "shot.toml").write_text("[dic]\nsubset = 21\n", encoding="utf-8")
    (shot / "truth.json").write_text('{"m": 1.2}', encoding="utf-8")
    asked: list[str] = []

    def attempt(study: Study, name: str, folder: Path, cure: str = "") -> Answer:
        asked.append(cure)
        if len(asked) == 2:
            raise KeyboardInterrupt
        return replace(RIGHT, value=None, sigma=None, answered=bool(cure), cure=cure, cured=[])

    monkeypatch.setattr(forty_shots, "attempt", attempt)
    study = Study(spec="no.toml", out=str(tmp_path))
    with pytest.raises(KeyboardInterrupt):
        one(study, "a")
    assert one(study, "a").end.cure == "larger subsets"
    assert one(study, "a").end.answered
    assert asked == ["", "larger subsets", "larger subsets"]


def test_every_shot_is_tried_before_a_cure_and_all_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of three shots the first is refused until it is given a finer mesh: that comes last."""
    asked: list[tuple[str, str]] = []
    for name in ("a", "b", "c"):
        shot = tmp_path / "shots" / name
        shot.mkdir(parents=True)
        (shot / "shot.toml").write_text("[dic]\nsubset = 21\n", encoding="utf-8")
        (shot / "truth.json").write_text('{"m": 1.2}', encoding="utf-8")

    def attempt(study: Study, name: str, folder: Path, cure: str = "") -> Answer:
        asked.append((name, cure))
        return replace(RIGHT, name=name, answered=name != "a" or bool(cure), cure=cure, cured=[])

    monkeypatch.setattr(forty_shots, "attempt", attempt)
    study = Study(spec=str(SPEC), out=str(tmp_path))
    came = [[answer.end.kind for answer in answers] for answers in attempts(study, ["a", "b", "c"], 1)]
    assert asked == [("a", ""), ("b", ""), ("c", ""), ("a", "a finer mesh")]
    assert came == [["refused"], ["refused", "right"], ["refused", "right", "right"], ["right"] * 3]
    asked.clear()
    uncured = replace(study, out=str(tmp_path / "again"), cures=False)
    (tmp_path / "again").mkdir()
    (tmp_path / "shots").rename(tmp_path / "again" / "shots")
    kept = list(attempts(uncured, ["a", "b"], 1))[-1]
    assert asked == [("a", ""), ("b", "")]
    found = write(uncured, kept, "")
    assert (found["right"], found["refused"]) == (1, 1)
    assert kept_answers(tmp_path / "again" / "forty.json") == kept
    assert json.loads((tmp_path / "again" / "forty.json").read_text("utf-8"))["shots"] == 2


def test_cores_are_shared_out_among_workers() -> None:
    assert shares(range(8), 3) == ((0, 1), (2, 3, 4), (5, 6, 7))
    assert shares([3, 5, 7, 9], 2) == ((3, 5), (7, 9))
    assert shares([4, 6], 3) == ((4,), (6,), (4,))


@pytest.mark.skipif(sys.platform != "linux", reason="needs a system that keeps a process to cores")
def test_a_worker_keeps_to_its_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    """What counts its threads by the cores it may use sees its share."""
    before = os.sched_getaffinity(0)
    monkeypatch.setenv(WORKER, "3")
    try:
        keep_to(())
        assert os.sched_getaffinity(0) == before
        keep_to(shares(sorted(before), len(before) + 2))
        assert os.sched_getaffinity(0) == {sorted(before)[3 % len(before)]}
        assert cores() == 1
    finally:
        os.sched_setaffinity(0, before)
