"""The table of the campaign and the sizes of the growth: counts, stored values, comparisons; no speeds."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from benchmarks import campaign, growth
from benchmarks.campaign import Answer, Question


def entry(**changed: Any) -> dict[str, Any]:
    """A measurement of two workers that identified four shots in two minutes."""
    known = {
        "device": "cpu",
        "gpus": 0,
        "workers": 2,
        "each": 2.0,
        "hold": [],
        "mesh": "4x6",
        "refined": "6x8",
        "where": "a",
    }
    found = {"identifications": 4, "seconds": 120.0, "answers": {"1": "0x1p+0", "2": "0x1.8p+0"}}
    return {**known, **found, **changed}


def test_efficiency_is_the_rate_of_a_worker_over_that_of_the_fewest() -> None:
    one = entry(workers=1, identifications=2, seconds=100.0)
    rows = campaign.table([one, entry(), entry(where="b", seconds=60.0)]).splitlines()[2:]
    assert [row.split(" | ")[5:7] for row in rows] == [["1.2", "1.00"], ["2", "0.83"], ["4", "1.00"]]


def test_the_same_seed_must_have_the_same_bits() -> None:
    other = entry(workers=4, answers={"2": "0x1.8p+0", "3": "0x1p+1"})
    wrong = entry(workers=8, answers={"3": "0x1.0000000000001p+1"})
    assert campaign.same_bits([entry(), other], other)
    assert not campaign.same_bits([entry(), other, wrong], other)
    assert campaign.same_bits([entry(), other, {**wrong, "device": "cuda"}], other)  # sums in another order
    assert "| no |" in campaign.table([other, wrong])


def test_a_newer_measurement_takes_the_place_of_the_same() -> None:
    kept = [entry(), entry(workers=4)]
    assert campaign.merged(kept, entry(seconds=90.0)) == [entry(seconds=90.0), entry(workers=4)]
    assert len(campaign.merged(kept, entry(gpus=1))) == 3


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Seeds that the workers were asked for, by workers which are functions here."""
    seeds: list[int] = []

    def answered(question: Question) -> Answer:
        seeds.append(question.seed)
        return Answer(float(question.seed).hex(), f"here {len(seeds) % 2}")

    @contextmanager
    def workers(count: int, dask: str | None) -> Iterator[Any]:
        yield (lambda work, question: work(question)), list

    monkeypatch.setattr(campaign, "identified", answered)
    monkeypatch.setattr(campaign, "workers_of", workers)
    return seeds


def test_what_is_done_is_not_done_again(asked: list[int], tmp_path: Path) -> None:
    file = tmp_path / "campaign.json"
    words = ["--each", "3", "--json", str(file)]
    campaign.main(["--workers", "2", *words])
    assert asked == [campaign.WARM_UP] * 2 + [1, 2, 3, 4, 5, 6]
    campaign.main(["--workers", "2", *words])
    assert len(asked) == 8
    (found,) = json.loads(file.read_text())
    assert found["identifications"] == 6
    assert found["answers"]["5"] == (5.0).hex()
    campaign.main(["--workers", "2", "--again", *words])
    assert len(asked) == 16


def test_workers_that_are_missing_are_an_error(asked: list[int]) -> None:
    questions = [Question(seed, "cpu", (), (4, 6), (6, 8)) for seed in range(1, 13)]
    with pytest.raises(RuntimeError, match="3 workers were meant to answer, 2 did"):
        campaign.campaign(questions, 3)


def test_a_measurement_takes_about_as_many_updates_whatever_grows() -> None:
    assert growth.steps_for(3e7, 352, 100) == 852
    assert growth.steps_for(3e7, 352, 1) == growth.STEPS[1]
    assert growth.steps_for(3e7, 352, 100_000) == growth.STEPS[0]


def test_sizes_reach_from_the_smallest_to_what_is_asked_for() -> None:
    sizes = [one["size"] for one in growth.wanted("cuda", ["elements"], {}) if one["precision"] == "fp64"]
    assert (sizes[0], sizes[-1]) == (88, 100_096)
    few = growth.wanted("cpu", ["runs", "points"], {"runs": 10, "points": 1000})
    assert [(one["what"], one["size"]) for one in few] == [
        ("runs", 1), ("runs", 10), ("runs", 1), ("runs", 10), ("points", 1000),
    ]  # fmt: skip
    assert max(one["size"] for one in growth.wanted("cuda", ["points"], {})) == 4_000_000


def test_a_rate_is_of_all_updates(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(growth, "UPDATES", {"cpu": 1000.0})
    monkeypatch.setattr(growth, "STEPS", (2, 5))
    monkeypatch.setattr(growth, "least", lambda work, device: (work(), 0.5)[1])
    found = growth.simulations((3, 4), 2, "fp64", "cpu")
    assert found == {"steps": 5, "seconds": 0.5, "rate": 2 * 5 * 12 * 2}


def test_points_are_those_of_all_frames_and_cameras(monkeypatch: pytest.MonkeyPatch) -> None:
    from benchmarks import dic_large

    def whole(side: int, points: int, frames: int, device: str) -> dict[str, Any]:
        return {"points": points, "valid": 1.0, "seconds": 2.0, "processor_seconds": 4.0}

    monkeypatch.setattr(dic_large, "whole", whole)
    assert growth.points(10_000, "cuda") == {"points": 10_000, "valid": 1.0, "seconds": 2.0, "rate": 5000}
    assert growth.points(10_000, "cpu")["rate"] == 2500


def test_growth_goes_on_and_is_drawn(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    file, done = tmp_path / "growth.json", []

    def measured(one: dict[str, Any], device: str) -> dict[str, Any]:
        done.append((one["what"], one["size"], one["precision"]))
        return {"seconds": 1.0, "rate": one["size"]}

    monkeypatch.setattr(growth, "measured", measured)
    monkeypatch.setattr(growth, "select_device", lambda name: SimpleNamespace(name="cpu"))
    words = ["--largest-runs", "10", "--largest-points", "1000", "--json", str(file)]
    growth.main(words)
    assert len(done) == len(set(done)) == 2 * (len(growth.MESHES) + 2) + 1
    growth.main(words)
    assert len(done) == 17
    entries = json.loads(file.read_text())
    assert [one["size"] for one in entries if one["what"] == "runs"] == [1, 10, 1, 10]
    growth.main([*words, "--draw", str(tmp_path / "growth.svg")])
    text = (tmp_path / "growth.svg").read_text()
    assert text.count("<svg") == 1
    assert growth.table(entries).count("\n") == 2 + 17 - 1


def test_every_machine_has_its_columns() -> None:
    sizes = [{"what": "points", "size": n, "precision": ""} for n in (1000, 4_000_000)]
    here = {**sizes[0], "device": "cpu", "where": "a", "seconds": 1.25, "rate": 831.4}
    there = [{**one, "device": "cuda", "where": "b", "seconds": 0.5, "rate": 2e6} for one in sizes]
    head, _, *rows = growth.table([*there, here]).splitlines()
    assert head.split(" | ")[4:] == ["a, one core, s", "a second", "b, s", "a second |"]
    assert [row.split(" | ")[1:] for row in rows] == [
        ["1 000", "–", "points", "1.25", "831", "0.5", "2 million |"],
        ["4 000 000", "–", "points", "–", "–", "0.5", "2 million |"],
    ]


def test_other_meshes_are_another_measurement() -> None:
    fine = entry(mesh="24x32", answers={"1": "0x1.1p+0"}, workers=1)
    assert campaign.merged([entry(workers=1)], fine) == [entry(workers=1), fine]
    assert campaign.same_bits([entry(workers=1), fine], fine)
    assert all(" 1.00 " in row for row in campaign.table([entry(), fine]).splitlines()[2:])
