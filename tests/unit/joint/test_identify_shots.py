"""Shots together: one shot counted twice, the ledger, what relaxes in an elastic shot, page and files."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from kolsky.base.errors import InputError
from kolsky.cli.commandline import app
from kolsky.inverse.forward import Numerics
from kolsky.inverse.joint_result import CurveFound, JointResult, JointSettings, ModelChoice
from kolsky.inverse.parameters import with_relaxation
from kolsky.joint_identification import identify_shots
from kolsky.report.result_folder import write_results
from kolsky.results.joint import read_joint_hdf5, to_json, write_joint_hdf5
from kolsky.shot.load import load_shot
from kolsky.shot.records import Shot

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
    assert result.scatter is not None
    assert result.scatter.value == 0.0
    assert [part.factor for part in result.shots] == pytest.approx([e.on_mesh, e.on_mesh])
    assert result.shots[0].chi2_force == result.shots[1].chi2_force
    assert result.expanded["stiffness_factor"] == pytest.approx(2.0 * e.sigma)


def test_a_curve_without_bends_is_a_line_in_the_logarithm(shots: list[Shot]) -> None:
    single = identify_shots(
        shots[:1], replace(SETTINGS, curve_nodes=4, curve_roughness=1e-4, free={"poisson": (0.4985, 0.4995)})
    )
    assert single.curve is not None
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
    done = CliRunner().invoke(app, ["report", str(tmp_path / "out"), "--json"])
    assert done.exit_code == 0, done.output
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
    with pytest.raises(ValueError, match="one shot by itself is identified alone"):
        identify_shots(shots[:1], SETTINGS)
    with pytest.raises(ValueError, match="two shots are called a"):
        identify_shots([shots[0], shots[0]], SETTINGS)
    with pytest.raises(ValueError, match=r"\[relaxation\] differ in kind"):
        identify_shots([shots[0], with_relaxation(shots[1], "prony")], SETTINGS)
    with pytest.raises(ValueError, match="prony_time_1 has no effect"):
        identify_shots(shots, replace(SETTINGS, free={"prony_time_1": None}))
