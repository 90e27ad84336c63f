"""Joint identification: one shot counted twice, the ledger, relaxation in an elastic shot, page and files."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from kolsky_command import run_kolsky

from kolsky.base.errors import InputError
from kolsky.base.records import CentreLine
from kolsky.cli.identify import answer_lines
from kolsky.inverse.joint_result import (
    RANGE,
    CurveFound,
    JointResult,
    ModelChoice,
    as_not_seen,
    interval,
    needed_strength,
)
from kolsky.inverse.parameters import with_relaxation
from kolsky.inverse.result import Estimate, Verdict
from kolsky.inverse.settings import JointSettings, Numerics
from kolsky.joint_identification import identify_shots
from kolsky.report.pages.identification import joint_rows, parameter_row
from kolsky.report.result_folder import write_results
from kolsky.results.joint import read_joint_hdf5, to_json, write_joint_hdf5
from kolsky.results.numbers import percent, plain_sentence
from kolsky.shot.load import load_shot
from kolsky.shot.records import Shot
from kolsky.uncertainty.budgets import _place_change, outlines_with_diameter

OPEN_01 = Path(__file__).parents[3] / "runs" / "open-01"
SETTINGS = JointSettings(
    free={"stiffness_factor": (0.8, 1.6)},
    numerics=Numerics(mesh=(4, 6), threads=1),
    refined_mesh=(6, 8),
    replicates=2,
)


@pytest.fixture(scope="module")
def shots() -> list[Shot]:
    """A third of one shot, twice, under two names."""
    shot = load_shot(OPEN_01)
    first = shot.window[0]
    short = replace(shot, window=(first, first + 0.3 * (shot.window[1] - first)), uncertainty={})
    return [replace(short, name="a"), replace(short, name="b")]


@pytest.fixture(scope="module")
def found(shots: list[Shot], tmp_path_factory: pytest.TempPathFactory) -> tuple[JointResult, Path]:
    ledger = tmp_path_factory.mktemp("joint") / "joint.sqlite"
    return identify_shots(shots, SETTINGS, ledger=ledger), ledger


def test_one_shot_counted_twice_has_no_scatter_and_the_same_answer(
    shots: list[Shot], found: tuple[JointResult, Path]
) -> None:
    result, _ = found
    e = result.estimates["stiffness_factor"]
    assert result.scatter.value == 0.0
    assert [part.factor for part in result.shots] == pytest.approx([e.on_mesh, e.on_mesh])
    assert result.shots[0].chi2_force == result.shots[1].chi2_force
    assert result.expanded["stiffness_factor"] == pytest.approx(2.0 * e.sigma)


def test_a_curve_without_bends_is_a_line_in_the_logarithm(shots: list[Shot]) -> None:
    single = identify_shots(
        shots[:1], replace(SETTINGS, curve_nodes=4, curve_roughness=1e-4, free={"poisson": (0.4985, 0.4995)})
    )
    # So smooth that the factor's logarithm is a straight line over the strain: its bends are of the prior.
    np.testing.assert_allclose(np.diff(np.log(single.curve.factor), n=2), 0.0, atol=3e-4)
    assert not single.estimates.keys() - {"poisson"}


def test_a_ledger_goes_on_where_it_ended(shots: list[Shot], found: tuple[JointResult, Path]) -> None:
    result, ledger = found
    assert result.runs > 0
    again = identify_shots(shots, SETTINGS, ledger=ledger)
    assert again.runs == 0
    assert again.estimates["stiffness_factor"] == result.estimates["stiffness_factor"]


def test_files_and_page_say_the_same(found: tuple[JointResult, Path], tmp_path: Path) -> None:
    result, _ = found
    write_results(tmp_path / "out", result)
    said = json.loads((tmp_path / "out" / "joint.json").read_text("utf-8"))
    assert said == to_json(result)
    e = result.estimates["stiffness_factor"]
    assert said["estimates"]["stiffness_factor"]["value"] == e.value
    assert said["reference_curve"] == "the quasi-static curve"
    page = (tmp_path / "out" / "joint.html").read_text("utf-8")
    assert "2 shots" in page
    assert "<svg" in page
    m = plain_sentence(parameter_row(result, "stiffness_factor")["Value"])
    assert answer_lines(result)[0].startswith(f"m = {m} +- ")
    rows = joint_rows(result)
    assert rows["verdict"] == result.verdict
    assert f"gain {plain_sentence(percent(result.shots[1].gain))}" in rows["b"]
    table = (tmp_path / "out" / "joint_shots.csv").read_text("utf-8").splitlines()
    assert [row.split(",")[0] for row in table] == ["shot", "a", "b"]


def test_the_result_file_gives_the_same_result(found: tuple[JointResult, Path], tmp_path: Path) -> None:
    result, _ = found
    choice = ModelChoice(
        -3.0, 1.5, {"poisson": 0.49}, 7.0, float("nan"), 0.02, asked_for=False, sentence="no"
    )
    nodes, points = np.linspace(0.0, 1.0, 4), np.linspace(1.0, 0.4, 6)
    curve = CurveFound(nodes, nodes + 1.0, nodes, nodes, points, -points, np.stack([points, points]))
    whole = replace(result, choice=choice, curve=curve, slow={"held at 20 %": 1.5}, warnings=("one", "two"))
    for one in (result, whole):
        write_joint_hdf5(tmp_path / "joint.h5", one)
        back = read_joint_hdf5(tmp_path / "joint.h5")
        assert to_json(back) == to_json(one)
        assert back.estimates == one.estimates
        assert back.shots == one.shots
    (tmp_path / "joint.h5").write_bytes((tmp_path / "joint.h5").read_bytes()[:2000])
    with pytest.raises(InputError):
        read_joint_hdf5(tmp_path / "joint.h5")


def test_report_makes_the_page_again(found: tuple[JointResult, Path], tmp_path: Path) -> None:
    write_results(tmp_path / "out", found[0])
    page = (tmp_path / "out" / "joint.html").read_text("utf-8")
    for name in ("joint.html", "joint.json", "joint_shots.csv"):
        (tmp_path / "out" / name).unlink()
    run_kolsky("report", tmp_path / "out", "--json")
    assert (tmp_path / "out" / "joint.html").read_text("utf-8") == page
    assert (tmp_path / "out" / "joint.json").exists()


class Stopped(Exception):
    """What a user's stop looks like."""


def test_a_search_that_is_stopped_goes_on_where_it_ended(
    shots: list[Shot], found: tuple[JointResult, Path], tmp_path: Path
) -> None:
    """Stopped at some stage by an exception from the progress callback, then started again."""
    whole, ledger = found[0], tmp_path / "joint.sqlite"
    made: list[int] = []

    def stop(stage: str, done: int, total: int) -> None:
        if done == 0 and len(made) > 4:
            raise Stopped
        if done == total:
            made.append(total)

    with pytest.raises(Stopped):
        identify_shots(shots, SETTINGS, ledger=ledger, progress=stop)
    again = identify_shots(shots, SETTINGS, ledger=ledger)
    assert again.runs == whole.runs - sum(made)  # none is made twice, none is missing
    assert 0 < again.runs < whole.runs
    assert again.estimates == whole.estimates


def test_shots_that_cannot_be_joined_are_refused(shots: list[Shot]) -> None:
    with pytest.raises(ValueError, match="one shot is not a joint identification"):
        identify_shots(shots[:1], SETTINGS)
    with pytest.raises(ValueError, match="two shots are called a"):
        identify_shots([shots[0], shots[0]], SETTINGS)
    with pytest.raises(ValueError, match=r"\[relaxation\] differ in kind"):
        identify_shots([shots[0], with_relaxation(shots[1], "prony")], SETTINGS)
    with pytest.raises(ValueError, match="prony_time_1 has no effect"):
        identify_shots(shots, replace(SETTINGS, free={"prony_time_1": None}))


def test_only_outlines_placed_by_a_radius_move() -> None:
    """Two shots of a force bin and two outline points each; 0.1 % of 10 mm and 0.2 % of 8 mm."""
    shots: list[Any] = [
        SimpleNamespace(axis_by_radius=placed, specimen=SimpleNamespace(diameter=diameter))
        for placed, diameter in ((False, 10e-3), (True, 8e-3))
    ]
    data: list[Any] = [SimpleNamespace(objective=SimpleNamespace(n_force=1))] * 2
    change = np.array([3.0, 6e-6, 7e-6, 4.0, 9e-6, 8e-6, 5.0])
    found = outlines_with_diameter(change, shots, data, (3, 6), np.array([1e-3, 2e-3]))
    np.testing.assert_allclose(found, [3.0, 6e-6, 7e-6, 4.0, 1e-6, 0.0, 5.0], atol=1e-18)


def test_a_higher_outline_is_compared_with_a_wider_model() -> None:
    """Two shots of a force bin and three outline points each, on cones of slopes 0.2 and 0.5; the second
    outline is 3 um too high."""
    y = np.array([1e-3, 2e-3, 3e-3])
    data: list[Any] = []
    for slope in (0.2, 0.5):
        line = CentreLine(np.zeros(3), np.zeros(3, dtype=np.int64), y, 5e-3 + slope * y, np.full(3, 1e-6))
        seen = SimpleNamespace(centre_line=line)
        counted = np.ones(3, dtype=bool)
        data.append(SimpleNamespace(objective=SimpleNamespace(n_force=1), observations=seen, counted=counted))
    stack = SimpleNamespace(data=np.zeros(8), shots=data, place=lambda k: slice(4 * k, 4 * k + 4))
    problem: Any = SimpleNamespace(stack=stack)
    moved = _place_change(problem, np.array([0.0, 3e-6]), "y_offset")
    np.testing.assert_allclose(moved, [0.0] * 5 + [1.5e-6] * 3, rtol=1e-9, atol=1e-18)
    axis = _place_change(problem, np.array([1e-6, 0.0]), "Z_offset")
    np.testing.assert_allclose(axis, [0.0] + [-1e-6] * 3 + [0.0] * 4, atol=1e-18)


SOURCES = ("force and shape", "scatter between shots")
STRENGTH = Estimate(
    "prony_strength_1", "1", 0.004, 0.03, 0.04, 0.0, dict.fromkeys(SOURCES, 0.01), Verdict.IDENTIFIED,
    mesh_correction=-0.002, searched=(0.0, 2.0),
)  # fmt: skip
TIME = Estimate(
    "prony_time_1", "s", 1.3e-4, 2e-5, 1e-5, 3e-5, dict.fromkeys(SOURCES, 1e-5), Verdict.CONDITIONAL,
    numerical_parts={"mesh": 1e-5}, mesh_correction=1.1e-4, searched=(2e-5, 5e-3),
)  # fmt: skip


def test_a_strength_keeps_its_upper_limit_and_is_never_negative() -> None:
    found = as_not_seen(STRENGTH)
    assert found == replace(STRENGTH, outcome=Verdict.NOT_SEEN)
    assert found.sigma == pytest.approx(0.05)  # 3-4-5
    assert interval(found, 2.0 * found.sigma) == pytest.approx((0.0, 0.104))


def test_a_time_of_no_branch_is_anywhere_in_its_range() -> None:
    """No correction, and the standard deviation of a range whose values are evenly likely."""
    found = as_not_seen(TIME)
    assert found.value == pytest.approx(2e-5)  # 130 us less the correction of 110
    assert (found.mesh_correction, found.mesh_shift, found.sigma_numerical) == (0.0, 0.0, 0.0)
    assert found.sigma == pytest.approx((5e-3 - 2e-5) / 12.0**0.5)
    assert found.noise_parts == {"force and shape": 0.0, "scatter between shots": 0.0, RANGE: found.sigma}
    assert found.numerical_parts == {"mesh": 0.0}
    assert found.outcome is Verdict.NOT_SEEN
    # 20 us with a half width of 2.9 ms would have been -2.9 to 2.9 ms.
    assert interval(found, 2.0 * found.sigma) == (2e-5, 5e-3)


def test_what_does_not_relax_stays_as_it_is() -> None:
    m = replace(TIME, name="stiffness_factor", unit="1")
    assert as_not_seen(m) is m
    assert interval(m, 1e-4) == pytest.approx((3e-5, 2.3e-4))


def test_it_says_which_strength_would_be_seen() -> None:
    weak = {e.name: as_not_seen(e) for e in (STRENGTH, TIME)}
    (said,) = needed_strength(weak)
    assert "prony_strength_1 and what depends on it are not seen: a strength above 0.1 is needed, 2 " in said
    assert "without one prony_time_1 has no value" in said
    assert "has no value" not in needed_strength({"prony_strength_1": weak["prony_strength_1"]})[0]
    # One that is seen, and one that something else speaks against.
    assert needed_strength({"prony_strength_1": STRENGTH, "prony_time_1": TIME}) == []
    strong = replace(weak["prony_strength_1"], value=0.11)
    assert needed_strength({"prony_strength_1": strong}) == []
