"""The tables that pages make of a study's results."""

import json
import re
import runpy
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from module_files import module_at
from page_values import evaluated, stored

from benchmarks import equilibrium_table
from populations import answers, incompressible_shots

ROOT = Path(__file__).parents[3]
TABLES = ROOT / "docs" / "_ext" / "made_tables.py"


@pytest.fixture(scope="module")
def tables() -> ModuleType:
    return module_at(TABLES, "made_tables_of_studies")


def test_every_study_and_benchmark_has_a_help(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """`python -m` of each with `--help` prints the options and runs nothing."""
    started = []
    for path in sorted([*ROOT.glob("populations/*.py"), *ROOT.glob("benchmarks/*.py")]):
        if '__name__ == "__main__"' not in path.read_text("utf-8"):
            continue
        monkeypatch.setattr("sys.argv", [path.name, "--help"])
        with pytest.raises(SystemExit) as ended:
            runpy.run_path(str(path), run_name="__main__")
        assert ended.value.code == 0, path
        assert capsys.readouterr().out.startswith("usage: "), path
        started.append(path.stem)
    assert {"coverage", "thesis_cylinder", "damping_and_stiffness"} <= set(started)


def test_every_committed_result_is_read(tables: ModuleType) -> None:
    """By the table that a page requests, or else by that of its study: with a number at least."""
    asked = {
        name: kind
        for page in (ROOT / "docs").rglob("*.md")
        for kind, name in tables.LINE.findall(page.read_text("utf-8"))
    }
    bars = module_at(ROOT / "tests" / "validation" / "bars_page.py")
    elsewhere: dict[str, Callable[[Any], str]] = {
        "bar_signals": lambda _: "\n".join(map(str, stored(bars.DOCS / "bars.md")["made"])),
        "incompressible_shots": lambda made: incompressible_shots.table(made["each"]),
        "right_second": lambda made: answers.scatter(made["answers"]),
    }
    kinds = {"coverage": "coverage", "forty": "drawn"}  # files of a kind that no page requests
    in_words = {"mesh_windows", "truth_meshes"}  # their pages quote single numbers
    in_baseline = {"baseline_specimens", "bonded_cylinders", "thesis_cylinder"}
    for path in sorted((ROOT / "populations" / "results").glob("*.json")):
        name = path.stem
        made = json.loads(path.read_text("utf-8"))
        if name in in_words | in_baseline:
            continue
        if name in elsewhere:
            text = elsewhere[name](made)
        else:
            text = tables.TABLES[asked.get(name) or kinds[name.split("_")[0]]](name)
        assert re.search(r"\d", text), name


def test_the_page_of_corrected_specimens_is_made_of_its_results() -> None:
    """The numbers of `docs/validation/baseline.md` are what `tests/validation/baseline_page.py` writes."""
    made = module_at(ROOT / "tests" / "validation" / "baseline_page.py")
    assert stored(made.PAGE) == evaluated(made.PAGE, vars(made) | made.shown())


def test_budget_of_the_paper(tables: ModuleType) -> None:
    """Shares sum to 1, and those of the paper's uncertainty are (2 u / 0.18)^2."""
    lines = tables.budget("paper_budget").splitlines()[2:]
    rows = [line.split("|")[1:-1] for line in lines if line.startswith("|")]
    sources = [row for row in rows if row[3].strip()]
    assert sum(float(row[3].split("%")[0]) for row in sources) == pytest.approx(100.0, abs=1.0)
    for row in rows:
        U, share = float(row[2].split()[0]), float(row[4].strip().rstrip("% "))
        assert share == pytest.approx(100.0 * (U / 0.18) ** 2, rel=0.1, abs=0.01)


def test_a_study_that_was_not_run_says_so(tables: ModuleType) -> None:
    assert "not run yet" in tables.budget("no_such_study")
    for name in ("drawn", "answers", "pooled", "equilibria", "planted", "advised", "solved"):
        assert "not run yet" in tables.TABLES[name]("no_such_study")


def test_what_a_study_was_made_with(tables: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    made = tables._results("paper_budget")
    how = {"mesh": [16, 22], "refined_mesh": [32, 44], "truth_mesh": [64, 86], "draws": 24, "together": 96}
    monkeypatch.setattr(tables, "_results", lambda _: {**made, "made_with": how})
    assert tables.budget("any").endswith(
        "Searched on 16 × 22 elements, answered on 32 × 44, truths on 64 × 86; 24 draws of the noise, 96 of "
        "all errors at once."
    )
    shot = {
        "name": "a", "truth": 1.0, "value": 1.01, "sigma": 0.005, "verdict": "identified", "seconds": 60.0,
    }  # fmt: skip
    drawn = {"seed": 7, "right": 1, "scatter": 2.0, "largest": 2.0, "answers": [{**shot, "kind": "right"}]}
    monkeypatch.setattr(tables, "_results", lambda _: drawn)
    lines = tables.drawn("any").splitlines()
    assert lines[0] == (
        "Of 1 shots (seed 7): 1 right; errors of the answered over their standard uncertainties: 2.00 root "
        "mean square, 2.0 at most."
    )
    assert "| 1.0100 | 0.0100 | +1.00 % |" in lines[-1]


def answer(value: float, sigma: float, verdict: str = "identified") -> dict[str, Any]:
    """A made-up answer to a shot whose truth is 1.12."""
    cause = {"key": "flyer.time", "value": 2e-5, "evidence": 1093.4, "named": True, "beside": ""}
    other = {"key": "model.damping", "value": 3e-5, "evidence": 72.0, "named": False, "beside": "flyer.time"}
    return {
        "name": "made", "values": {"stiffness_factor": value}, "sigmas": {"stiffness_factor": sigma},
        "truths": {"stiffness_factor": 1.12}, "verdicts": {"stiffness_factor": verdict},
        "causes": [cause, other, cause],
    }  # fmt: skip


def test_answers_beside_their_truths() -> None:
    """(1.126 - 1.12) / 0.004 is 1.5 standard uncertainties; U is twice one."""
    told = answers.table({"made": answer(1.126, 0.004)})
    assert "| 1.12 | 1.126 ± 0.008 | +1.50 | identified |" in told
    assert "| made | **flyer.time = 2e-05** (1093); model.damping = 3e-05 beside flyer.time (72) |" in told


def test_changes_are_in_standard_uncertainties_of_the_earlier_answer() -> None:
    """From 1.120 ± 0.004 to 1.121 ± 0.005 (k = 1): a quarter of 0.004, and 1.25 times it."""
    before, now = {"made": answer(1.120, 0.004)}, {"made": answer(1.121, 0.005)}
    assert "| made | stiffness_factor | +0.250 | 1.250 | the same |" in answers.changes(now, before)
    now = {"made": answer(1.12, 0.004, "not explained by the model")}
    assert "identified -> not explained by the model |" in answers.changes(now, before)


def test_scatter_of_errors_over_their_uncertainties() -> None:
    """Errors of +1, -1, +3 and -3 standard uncertainties: mean 0, scatter sqrt(5), half of them inside."""
    drawn = [answer(1.12 + z * 0.004, 0.004) for z in (1.0, -1.0, 3.0, -3.0)]
    (row,) = answers.scatter(drawn).splitlines()[2:]
    assert [cell.strip() for cell in row.split("|")[2:-1]] == ["4", "+0.00", "2.24", "3.00", "2"]


def test_times_of_equilibria_are_merged(tmp_path: Path) -> None:
    settings = {
        "kind": "hex27", "steps": 1, "strain": 0.1, "linear": "auto", "device": "cpu", "where": "here",
    }  # fmt: skip
    measured = {"outcome": "COMPLETED", "processor seconds": 2.0, "factorisations": 3, "iterations": 4}
    small, large = (
        {
            **settings, **measured, "threads": 1, "cells": [n, 1, 1], "displacements": 1000 * n,
            "seconds": float(n),
        }
        for n in (1, 2)
    )  # fmt: skip
    path = tmp_path / "growth.json"
    path.write_text(json.dumps([large, {**small, "seconds": 9.0}]), "utf-8")
    again = equilibrium_table.merged(path, [small])
    assert again == [small, large]  # the older one of the same thing is gone
    assert equilibrium_table.merged(path, [{**small, "threads": 2}])[1]["seconds"] == 1.0
    row = equilibrium_table.table([{**large, "outcome": "SINGULAR"}]).splitlines()[-1]
    assert (
        row
        == "| 2 000 | 2 x 1 x 1 hex27 | 1 to 10 % | auto | cpu | here, 1 thread | 2 | 2 | 3, 4: SINGULAR |"
    )
    peer = {"dolfinx": {"processor seconds": 50.0}, "largest difference": 2e-10}
    said = equilibrium_table.table([{**large, **peer}]).splitlines()[-1]
    assert "50 s of the processor, 25.0 times as long" in said


def test_the_speed_of_the_solver_has_its_limit_and_its_peer(
    tables: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    row = {"contact": "bonded", "precision": "fp64", "runs": 1, "seconds": 0.1234, "time_loop_seconds": 0.1}
    row |= {
        "million_element_updates_per_s": 1234.5,
        "fraction_of": {"arithmetic": 0.02, "shared memory": 0.01},
    }
    sliding = {**row, "contact": "coulomb", "runs": 100}
    del sliding["time_loop_seconds"]
    made = {"machine": {"device": "GPU"}, "mesh": "64x86", "rows": [row, sliding]}
    monkeypatch.setattr(tables, "_results", lambda _: made)
    first, second = tables.TABLES["solved"]("any").splitlines()[-2:]
    assert first == "| bonded | fp64 | 1 | 0.123 | 0.1 | 1234 | 2 % |"
    assert second == "| coulomb | fp64 | 100 | 0.123 | – | 1234 | 2 % |"
    monkeypatch.setattr(
        tables, "_results", lambda _: {**made, "peer": {"times_as_long": {"1": 2700, "100": 3}}}
    )
    first, second = tables.TABLES["solved"]("any").splitlines()[-2:]
    assert first.endswith("| 2700 times as long |")
    assert second.endswith("| – |")  # its peer does not slide
