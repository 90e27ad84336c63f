"""The tables that pages make of a study's results."""

import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import pytest

TABLES = Path(__file__).parents[3] / "docs" / "_ext" / "made_tables.py"


@pytest.fixture(scope="module")
def tables() -> ModuleType:
    spec = spec_from_file_location("made_tables_of_studies", TABLES)
    assert spec is not None
    assert spec.loader is not None
    made = module_from_spec(spec)
    sys.modules[spec.name] = made
    spec.loader.exec_module(made)
    return made


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
    assert "not made yet" in tables.budget("no_such_study")
    assert "not run yet" in tables.drawn("no_such_study")
