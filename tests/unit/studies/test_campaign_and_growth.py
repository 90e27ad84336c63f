"""Tables of studies: the campaign, the growth, converged shots, plans and rate reports."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from ratedshots import rated

from benchmarks import campaign, growth
from benchmarks.campaign import Answer, Question
from kolsky.studies.local_sensitivity import LocalSensitivity, ObservationGrid
from kolsky.studies.planning.information import Expected, Instruments
from kolsky.studies.planning.plan import Choice, Plan, Rate, rows, to_json
from kolsky.studies.rates.comparison import compare
from kolsky.studies.rates.output import summary, tables
from populations import converged_shots
from populations.converged_shots import FLAT, converged, radius_at

# The table of the campaign and the sizes of the growth: counts, stored values, comparisons; no speeds.


def entry(**changed: Any) -> dict[str, Any]:
    """A measurement of two workers that identified four shots in two minutes."""
    known = {
        "device": "cpu", "gpus": 0, "workers": 2, "each": 2.0, "hold": [], "mesh": "4x6", "refined": "6x8",
        "where": "a",
    }  # fmt: skip
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
    def workers(count: int) -> Iterator[Any]:
        yield SimpleNamespace(map=map)

    monkeypatch.setattr(campaign, "identified", answered)
    monkeypatch.setattr(campaign, "process_pool", workers)
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


# Shots with converged histories: changes of their exports, in closed form.


def test_the_radius_of_a_side_that_has_folded_at_both_ends():
    """r = 5 mm + y^2 / 1 mm between two ends that lie on platens; beyond the free part there is none."""
    y = np.linspace(1e-3, 5e-3, 41)
    r = 5e-3 + y**2 / 1e-3
    folded_y = np.concatenate([[y[0] + FLAT / 2, y[0] + FLAT / 2], y, [y[-1], y[-1] + FLAT / 2]])
    folded_r = np.concatenate([[4e-3, 4.1e-3], r, [31e-3, 32e-3]])
    assert radius_at(folded_y, folded_r, 2.03e-3) == pytest.approx(5e-3 + 2.03e-3**2 / 1e-3, rel=1e-12)
    assert np.isnan(radius_at(folded_y, folded_r, 0.9e-3))
    assert np.isnan(radius_at(folded_y, folded_r, 5.1e-3))


class Run:
    """A course whose force is 3 N and whose radius is 6 mm."""

    def __init__(self, times, heights):
        self.force_transmission = np.full((1, times.size), 3.0)
        self.surface_y = np.broadcast_to(heights, (1, 3, heights.size))
        self.surface_r = np.full((1, 3, heights.size), 6e-3)


class Course:
    """The other program's: 2 N and 5 mm, in three frames from 10 us on."""

    true = np.array([1.0, 0.499, 25e-6])

    def __init__(self, name):
        self.heights = np.linspace(0.0, 4e-3, 9)
        frames = 1e-5 * np.arange(1.0, 4.0)
        self.seen = {
            "t": frames,
            "y": np.broadcast_to(self.heights, (3, 9)),
            "r": np.full((3, 9), 5e-3),
            "transmitted": np.full(40, 2.0),
        }
        self.times = 1e-6 * np.arange(40.0) - 1e-5
        self.within = (self.times > -1e-9) & (self.times < 2e-5 + 1e-9)

    def runs(self, points, mesh, *, element, grading):
        return Run(self.times[self.within], self.heights)


def test_the_difference_of_the_courses_is_added_and_the_noise_stays(tmp_path, monkeypatch):
    """1 N times 0.0112 V/N and 1 mm, from the beginning of the motion to its last frame; nothing at rest."""
    source = tmp_path / "runs" / "shot"
    source.mkdir(parents=True)
    (source / "shot.toml").write_text("")
    rows = [[0, 0.0, 1.0, 4.9, 0.004], [1, 1e-5, 1.0, 5.013, 0.004], [3, 3e-5, 9.0, 4.7, 0.004]]
    table = "\n".join(",".join(map(str, row)) for row in rows)
    (source / "centreline.csv").write_text(f"frame,time (s),y (mm),Z (mm),sigma_Z (mm)\n{table}\n")
    scope = np.stack([1e-6 * (np.arange(45.0) + 0.5), np.full(45, 7.0), 0.01 * np.arange(45.0)], axis=1)
    header = "Time (s),CH1 incident (V),CH2 transmitted (V)"
    np.savetxt(source / "scope.csv", scope, delimiter=",", header=header, comments="")
    facts = tmp_path / "shots" / "shot"
    facts.mkdir(parents=True)
    (facts / "facts.json").write_text(
        json.dumps({"scope": {"sensitivity_V_per_N": {"transmitted": 0.0112, "incident": 1.0}}})
    )
    monkeypatch.setattr(converged_shots, "RUNS", tmp_path / "runs")
    monkeypatch.setattr(converged_shots, "SHOTS", tmp_path / "shots")
    monkeypatch.setattr(converged_shots, "Course", Course)
    folder = converged("shot", tmp_path / "out")
    outline = np.loadtxt(folder / "centreline.csv", delimiter=",", skiprows=1)
    # At rest nothing differs; where the side has folded away there is nothing to compare.
    np.testing.assert_allclose(outline[:, 3], [4.9, 6.013, 4.7], rtol=1e-9)
    found = np.loadtxt(folder / "scope.csv", delimiter=",", skiprows=1)
    moves = (scope[:, 0] > 1e-5) & (scope[:, 0] < 3e-5)
    np.testing.assert_allclose(found[:, 2] - scope[:, 2], np.where(moves, 0.0112, 0.0), atol=1e-9)
    np.testing.assert_array_equal(found[:, 1], scope[:, 1])
    told = json.loads((folder / "converged.json").read_text())
    assert told == {"force, N rms": pytest.approx(1.0), "outline, um rms": pytest.approx(1e3)}


# A plan and a rate report as tables, JSON and lines: they quote twice the standard uncertainty.


def expected(m: float, damping: float) -> Expected:
    sigma = np.array([m, damping])
    return Expected(deviations=sigma, alone=0.5 * sigma, correlation=np.array([[1.0, -0.4], [-0.4, 1.0]]))


def rate(factor: float, m: float, damping: float, cost: float) -> Rate:
    return Rate(factor, 70.0, 400.0, (0.1, 1e-6), expected(m, damping), cost)


def plan() -> Plan:
    grid = ObservationGrid(np.array([0.0, 1e-3]), np.array([5e-4]), np.array([3e-3]))
    slopes = LocalSensitivity(
        names=("stiffness_factor", "damping"), point=np.array([1.2, 2e-5]), scale=np.array([0.1, 1e-5]),
        reach=0.1, grid=grid, force=np.array([50.0]), radius=np.array([[5e-3]]), force_slope=np.zeros((2, 1)),
        radius_slope=np.zeros((2, 1, 1)), force_left=np.zeros((2, 1)),
    )  # fmt: skip
    information: Any = SimpleNamespace(sensitivity=slopes)
    return Plan(
        shot="made-up",
        instruments=Instruments((0.0, 1e-3), 1e-5, 0.5, 8e-6, 1e4, 4e-6),
        discrepancy=(0.1, 1e-6),
        information=information,
        expected={"all": expected(0.02, 1e-6), "force": expected(0.03, 2e-6)},
        force_scale=np.array([0.005, 0.0]),
        end_times=np.array([1e-3]),
        by_end=(expected(0.02, 1e-6),),
        windows={0.5: Choice(np.array([2e-4, 7e-4]), np.array([0.04, 3e-6]))},
        heights={},
        rates=(rate(1.0, 0.02, 1e-6, 3.0), rate(2.0, 0.01, 4e-6, 2.0)),
        provenance={},
    )


def test_a_plan_in_json() -> None:
    said = to_json(plan())
    stiffness = said["parameters"]["stiffness_factor"]
    assert stiffness["interval"] == pytest.approx([1.2 - 0.04, 1.2 + 0.04], rel=1e-14)
    assert (stiffness["sigma"], stiffness["sigma_others_known"]) == (0.02, 0.01)
    assert stiffness["sigma_force"] == 0.03
    assert stiffness["shift_by_force_scale"] == 0.005
    assert said["correlations"] == {"stiffness_factor, damping": -0.4}
    assert said["best_rate"] == 2.0
    assert said["camera_windows"][0]["places"] == [2e-4, 7e-4]


def test_a_plan_in_lines() -> None:
    said = rows(plan())
    text = " | ".join(f"{name}: {value}" for name, value in said.items())
    assert "m: 1.200 ± 0.040 (k = 2, expected); 0.02 if the others were known" in text
    assert "beta: 20.0 ± 2.0 us (k = 2, expected); 1 if the others were known" in text
    assert "m, from one kind of data: force 0.06" in text
    assert "m, apart: ± 0.01 by the force's scale" in text
    assert "50 % of frames, D-optimal: 0.20 to 0.70 ms: m ± 0.08" in text
    assert "speed x 2: 400/s: m ± 0.02" in text
    assert said["best speed"].startswith("D-optimal x 2, for m x 2, for ")
    assert said["best speed"].endswith(" x 1")  # damping is known best at the shot's own speed


def test_a_rate_report_in_tables() -> None:
    m = (1.0, 1.1, 1.3)
    report = compare([rated(f"shot {i}", value, 300.0, own=0.01) for i, value in enumerate(m)])
    made = tables(report)
    assert made["rate_shots"]["u(m) (1)"] == pytest.approx([0.01] * 3, rel=1e-12)
    assert made["rate_shots"]["U(m) k=2 (1)"] == pytest.approx([0.02] * 3, rel=1e-12)
    deviation = np.std(m, ddof=1)
    groups = made["rate_groups"]
    assert groups["standard deviation s (1)"] == pytest.approx([deviation])
    assert groups["U = 2s (1)"] == pytest.approx([2.0 * deviation])
    assert groups["mean m (1)"] == pytest.approx([np.mean(m)])  # equal weights
    assert groups["degrees of freedom"] == [2.0]
    mean = summary(report)["groups"][0]["mean"]
    assert mean["two_standard_deviations"] == pytest.approx(2.0 * deviation)
    assert mean["interval_95"] == pytest.approx(
        [groups["95 % low (1)"][0], groups["95 % high (1)"][0]], rel=1e-14
    )
