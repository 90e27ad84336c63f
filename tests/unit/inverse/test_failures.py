"""Reports of failed runs to the user; the answer uses the other runs."""

import json
import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from kolsky_command import rows_of, run_kolsky
from shot_folders import OPEN_01, TINY
from synthetic import failed, synthetic

import explicit
from doe import Box
from explicit import Outcome, Response
from kolsky.base.files import write_tables
from kolsky.identification import identify
from kolsky.inverse.forward import Forward
from kolsky.inverse.problem import Freed, InverseProblem, PreparedShot, prepare_shot
from kolsky.inverse.result import Identification
from kolsky.inverse.runner import RUNS_OF_A_DESIGN, compile_for
from kolsky.inverse.settings import Numerics, Settings
from kolsky.inverse.simulate import simulate, write_simulation
from kolsky.inverse.work import Work
from kolsky.report.pages.identification import render
from kolsky.results.hdf5 import read_identification, write_identification
from kolsky.results.tables import tables, to_json
from kolsky.shot.load import load_shot

STOP = ["--past-data", "stop"]
"""The bonded shot strains its middle past the curve; a frictionless specimen stays homogeneous and below."""
WHERE = r"at \d+\.\d us in element \d+ \(R = \d\.\d\d mm, Y = \d\.\d\d mm\)"


@cache
def prepared(inputs: tuple[tuple[str, str], ...]) -> PreparedShot:
    return prepare_shot(load_shot(OPEN_01))


@pytest.fixture(autouse=True)
def prepared_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every test works on the same recordings, and to make them ready takes longer than to simulate them."""
    for module in ("inverse.simulate", "studies.sweep", "inverse.problem"):
        monkeypatch.setattr(
            f"kolsky.{module}.prepare_shot", lambda shot: prepared(tuple(shot.inputs.items()))
        )


# Commands


def test_simulate_writes_a_failed_run_up_to_its_end(shot: Path) -> None:
    run_kolsky("simulate", shot, *TINY, "--out", shot / "whole")
    result = run_kolsky("simulate", shot, *TINY, *STOP, "--json", "--vtu", code=1)
    said = json.loads(result.stdout)
    assert said["outcome"] == "TABLE_EXCEEDED"
    assert "phi" not in said  # the misfit belongs to the whole window
    assert said["cure"] == Outcome.TABLE_EXCEEDED.cure
    (warning,) = said["warnings"]
    assert re.match(f"the simulation ended TABLE_EXCEEDED {WHERE}: ", warning)
    assert f"warning: {warning}" in result.stderr
    folder = shot / "results" / "simulation"
    for name in ("force.csv", "profile.csv"):
        part, full = rows_of(folder / name), rows_of(shot / "whole" / "simulation" / name)
        assert 100 < len(part) < len(full)
        assert part == full[: len(part)]  # the same bits up to the end
        # What comes next in the data lies after the end, but for the step that failed.
        assert float(part[-1]["time (s)"]) <= said["end_time"] < float(full[len(part)]["time (s)"]) + 5e-6
    frames = {row["frame"] for row in rows_of(folder / "profile.csv")}
    assert len(list(folder.glob("mesh_*.vtu"))) == len(frames)


def test_simulate_tells_people_too(shot: Path) -> None:
    result = run_kolsky("simulate", shot, *TINY, *STOP, code=1)
    assert re.search(r"outcome +TABLE_EXCEEDED\n +end_time +0\.0013\d+\n +element +\d+\n", result.stdout)
    assert "nan" not in result.stdout


def test_a_crushed_outline_is_written_as_outside(tmp_path: Path) -> None:
    run = simulate(load_shot(OPEN_01), {}, numerics=Numerics(mesh=(8, 11), past_data="stop"))
    flat = run.response.surface_y.copy()
    flat[0, 20] = 1e-3  # no height is left between the platens
    run = replace(run, response=replace(run.response, surface_y=flat))
    write_simulation(tmp_path, run)
    rows = rows_of(tmp_path / "profile.csv")
    time = f"{run.response.surface_times[20]:.9g}"
    assert {row["inside (0/1)"] for row in rows if row["time (s)"] == time} == {"0"}
    assert {row["Z simulated (m)"] for row in rows if row["time (s)"] == time} == {"nan"}
    assert {row["inside (0/1)"] for row in rows if row["time (s)"] != time} == {"1"}


def test_a_sweep_answers_from_the_runs_that_completed(shot: Path) -> None:
    arguments = ["sweep", str(shot), *TINY, "--vary", "friction=0:0.6:4", "--json"]
    go_on = json.loads(run_kolsky(*arguments, "--out", shot / "whole").stdout)
    assert (go_on["completed"], go_on["failed_runs"]) == (4, [])
    result = run_kolsky(*arguments, *STOP)
    said = json.loads(result.stdout)
    assert (said["runs"], said["completed"]) == (4, 1)
    assert said["at"] == {"friction": 0.0}
    assert said["warnings"][0] == "3 of 4 runs did not complete (3 in design: TABLE_EXCEEDED)"
    assert re.match(
        rf"run 1 \(friction = 0\.2\) ended TABLE_EXCEEDED {WHERE}: .* Cure: ", said["warnings"][1]
    )
    rows, whole = rows_of(shot / "results" / "sweep.csv"), rows_of(shot / "whole" / "sweep.csv")
    assert rows[0] == whole[0]  # the same bits beside failing neighbours
    assert [row["element"] for row in rows] == ["", *(str(run["element"]) for run in said["failed_runs"])]
    for row, run in zip(rows[1:], said["failed_runs"], strict=True):
        assert float(row["end (s)"]) == pytest.approx(run["end_time"], rel=1e-8)  # nine digits
        assert [float(row[f"element {axis} (m)"]) for axis in "RY"] == pytest.approx(run["place"], rel=1e-8)
        assert row["ending"] == run["ending"]
        assert re.match(f"TABLE_EXCEEDED {WHERE}: .* Cure: ", row["ending"])


def test_a_sweep_of_failures_says_so(shot: Path) -> None:
    result = run_kolsky("sweep", shot, *TINY, "--vary", "friction=0.4:0.6:2", *STOP)
    assert re.search(r"completed +0\n +smallest_phi +none\n +at +none\n", result.stdout)
    assert "2 of 2 runs did not complete" in result.stderr


@pytest.mark.parametrize(
    ("command", "text", "message"),
    [
        ("identify", "later", '--past-data = "later" is not known; it must be continue or stop'),
        ("sweep", "", '--past-data = "" is not known; it must be continue or stop'),
    ],
)
def test_an_unknown_choice_past_the_data(shot: Path, command: str, text: str, message: str) -> None:
    result = run_kolsky(command, shot, "--past-data", text, code=2)
    assert message in result.stderr


# Identification

Lost = Callable[[np.ndarray, Numerics], np.ndarray]


@pytest.fixture
def losing(monkeypatch: pytest.MonkeyPatch) -> Callable[[Lost], None]:
    """Let runs fail whose stiffness factor and mesh a function picks: NaN from the middle on."""

    def fail(response: Response, lost: np.ndarray) -> Response:
        histories = {}
        for name in ("force_flyer", "force_transmission", "impulse_transmission", "surface_r", "surface_y"):
            history = getattr(response, name).copy()
            history[lost, history.shape[1] // 2 :] = np.nan
            histories[name] = history
        outcomes = zip(response.outcomes, lost, strict=True)
        return replace(
            response,
            outcomes=tuple(Outcome.INVERTED if gone else outcome for outcome, gone in outcomes),
            end_times=np.where(lost, 7e-4, response.end_times),
            failed_elements=np.where(lost, 7, -1),
            failed_places=np.where(lost[:, None], (4.45e-3, 0.30e-3), np.nan),
            **histories,
        )

    def install(pick: Lost) -> None:
        original = Forward.run

        def run(self: Forward, points: Any, numerics: Numerics, **options: Any) -> Response:
            response = original(self, points, numerics, **options)
            factor = np.broadcast_to(points["stiffness_factor"], response.n_samples)
            return fail(response, np.asarray(pick(factor, numerics)))

        monkeypatch.setattr(Forward, "run", run)

    return install


def found(replicates: int = 0) -> Identification:
    numerics = Numerics(mesh=(6, 8))
    settings = Settings(
        free={"stiffness_factor": None}, numerics=numerics, refined_mesh=(8, 11), replicates=replicates
    )
    return identify(load_shot(OPEN_01), settings)


@pytest.mark.slow  # two identifications
def test_an_answer_rests_on_the_runs_that_completed(losing: Callable[[Lost], None]) -> None:
    whole = found()
    losing(lambda m, numerics: (m > 1.8) & (m < 1.9))
    result = found()
    assert result.design.outcomes.count("INVERTED") == len(result.design.lost) == 1
    (warning,) = [text for text in result.warnings if "did not complete" in text]
    assert warning.startswith(
        f"1 of {len(result.design.outcomes)} runs did not complete (1 in design: INVERTED)"
    )
    (ended,) = [text for text in result.warnings if text.startswith("run ")]
    assert "ended INVERTED at 700.0 us in element 7 (R = 4.45 mm, Y = 0.30 mm)" in ended
    m, other = result.estimates["stiffness_factor"], whole.estimates["stiffness_factor"]
    # The second design lies where nothing fails: only where it is centred can have moved. On this mesh of
    # 8 x 11 elements that shows (0.43 sigma); on the default ones it does not.
    assert m.value == pytest.approx(other.value, abs=0.6 * other.sigma)
    assert np.isfinite([m.value, m.sigma, *m.interval]).all()
    assert to_json(result)["failed_runs"][0]["outcome"] == "INVERTED"


@pytest.mark.parametrize(
    ("pick", "message"),
    [
        (
            lambda m, numerics: m < 9.0,
            r"no run of the design completed: the one at stiffness_factor = 0.5 ended INVERTED at 700.0 us",
        ),
        (
            lambda m, numerics: m > 0.8,
            r"no surrogate can be fitted to the runs .* \(.*\): 6 of 7 .* ended INVERTED at 700.0 us",
        ),
        (
            lambda m, numerics: np.full(len(m), numerics.mesh == (8, 11)),
            r"the check needs every run .*: the one at .* ended INVERTED at 700.0 us in element 7",
        ),
        pytest.param(
            lambda m, numerics: (np.arange(len(m)) == 0) & (numerics.mesh == (16, 22)),
            r"the noise stage's reference run ended INVERTED at 700.0 us in element 7",
            marks=pytest.mark.slow,  # it comes last
        ),
    ],
    ids=["none left", "too few left", "check", "reference"],
)
def test_too_few_runs_are_refused_with_what_happened(
    losing: Callable[[Lost], None], pick: Lost, message: str
) -> None:
    losing(pick)
    with pytest.raises(ValueError, match=message) as refused:
        found(replicates=1)
    assert Outcome.INVERTED.cure in str(refused.value)


# Report and files


@pytest.mark.slow  # two reports with all their figures
def test_the_report_names_every_failure_once() -> None:
    page = render(synthetic())
    assert page.count(Outcome.INVERTED.cure) == 1
    assert Outcome.DIVERGED.cure not in page
    page = render(failed())
    # Among the kinds of failure, and for the simulation at the optimum.
    assert page.count(Outcome.INVERTED.cure) == 2


def test_failures_survive_the_file(tmp_path: Path) -> None:
    for result in (synthetic(), failed()):
        path = tmp_path / "identification.h5"
        write_identification(path, result)
        read = read_identification(path)
        for part, other in ((result.design, read.design), (result.response, read.response)):
            np.testing.assert_array_equal(part.failed_elements, other.failed_elements)
            np.testing.assert_array_equal(part.failed_places, other.failed_places)
            np.testing.assert_array_equal(part.end_times, other.end_times)
        assert [read.design.ending(i).sentence for i in read.design.lost] == [
            result.design.ending(i).sentence for i in result.design.lost
        ]
        assert read.response.describe(0) == result.response.describe(0)


def test_failures_in_tables(tmp_path: Path) -> None:
    result = synthetic()
    write_tables(tmp_path, tables(result))
    rows = rows_of(tmp_path / "design.csv")
    (lost,) = result.design.lost
    assert rows[lost]["element"] == "351"
    assert rows[lost]["ending"] == result.design.ending(lost).sentence
    assert all(
        row["ending"] == row["element"] == row["element R (m)"] == "" for row in rows if row != rows[lost]
    )


def test_a_sample_that_is_not_there() -> None:
    response = synthetic().response
    with pytest.raises(ValueError, match=r"sample must be in \[0, 0\], got 1"):
        response.ending(1)
    assert [ending.outcome for ending in response.endings] == [Outcome.COMPLETED]


def test_it_asks_for_what_it_will_run(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: dict[str, Any] = {}
    stages_told: list[tuple[str, int, int]] = []

    def problem(points: dict[str, Any], numerics: Numerics) -> tuple[Any, ...]:
        values = {name: value.tolist() for name, value in points.items()}
        return numerics.element, numerics.precision, values

    def compiled(problems: Any, *, also: Any, device: str, threads: int, progress: Any) -> int:
        asked.update(problems=problems, also=[make() for make in also], device=device, threads=threads)
        progress(1, 3)
        return 3

    monkeypatch.setattr(explicit, "compile_time_loops", compiled)
    shot = SimpleNamespace(interface=SimpleNamespace(faces="bonded", side="bonded"))
    prepared: Any = SimpleNamespace(forward=SimpleNamespace(problem=problem, shot=shot))
    settings = Settings(free={}, numerics=Numerics(threads=2), held={"damping": 2e-5})
    freed = Freed(settings, by_default=False, reasons={})
    made = InverseProblem(prepared, freed, Box.of({"stiffness_factor": (0.5, 2.0)}), None)
    compile_for(made, Work(lambda *at: stages_told.append(at)))
    one = {"damping": [2e-5], "stiffness_factor": [0.5]}
    many = {name: value * RUNS_OF_A_DESIGN for name, value in one.items()}
    coarse = [("one_point", "fp32", one), ("one_point", "fp32", many)]
    assert asked["problems"] == [*coarse, ("one_point", None, one)]  # the last is on the refined mesh
    assert asked["also"] == [("fbar", "fp32", one)]
    assert (asked["device"], asked["threads"]) == ("cpu", 2)
    assert stages_told == [("compile", 1, 3)]
