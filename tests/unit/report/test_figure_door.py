"""A new figure is one file and one entry in a registry: tests, page, command, data table, index."""

import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import test_report as battery
from html_pages import Page
from kolsky_command import rows_of
from module_files import module_at
from synthetic import RESULTS

from kolsky.report import figures
from kolsky.report.figures import RECORDINGS, REGISTRY, by_name
from kolsky.report.pages.identification import render
from kolsky.report.result_folder import PAGE, write_identify_page
from kolsky.shot.recordings import ShotRecordings

ROOT = Path(__file__).parents[3]
PEAK_FORCE = '''
"""Figure of the largest force: measured and simulated."""

from kolsky.report.figures.base import COLUMN, MEASURED, MODEL, figure


@figure(COLUMN, 60.0, [["peak"]], applies=lambda result: result.comparison.force_time.size > 0)
def peak_force(result, panels):
    ax, c = panels["peak"], result.comparison
    ax.plot([1.0], [c.force_measured.max()], "o", color=MEASURED, label="measured")
    ax.plot([2.0], [c.force_model.max()], "o", color=MODEL, label="simulated")
    ax.set(xlabel="Test (–)", ylabel="Force $F$ (N)")
    ax.legend()
    return f"Largest force of the test {result.shot}, measured and simulated."
'''


@pytest.fixture
def made_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The file of the figure, entered after "force"; the other figures are left out to save time."""
    file = tmp_path / "figures" / "peak_force.py"
    file.parent.mkdir()
    file.write_text(PEAK_FORCE, encoding="utf-8")
    for registry in (RECORDINGS, REGISTRY):
        for name in [name for name in registry if name != "force"]:
            monkeypatch.delitem(registry, name)
    monkeypatch.setitem(REGISTRY, "peak-force", module_at(file, "peak_force").peak_force)  # the one line
    return file


def test_it_gets_the_battery_of_every_figure(made_up: Path, tmp_path: Path) -> None:
    battery.test_figure_has_labelled_axes_with_units_and_its_data("peak-force", "one", tmp_path)


def test_it_gets_on_the_page(made_up: Path) -> None:
    html = render(RESULTS["one"])
    section = html[html.index("<h2>Further figures</h2>") : html.index("<h2>Provenance</h2>")]
    assert 'id="peak-force"' in section
    assert "<b>Figure 2.</b> Largest force of the test " in section  # after "force", which has its own place
    assert 'id="force"' not in section
    assert Page(html).ids.count("peak-force") == 1


def test_without_such_a_figure_the_page_has_no_such_section(made_up: Path, monkeypatch) -> None:
    monkeypatch.delitem(REGISTRY, "peak-force")
    assert "Further figures" not in render(RESULTS["one"])


def test_a_command_saves_it_with_its_data(
    made_up: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "results"
    folder.mkdir()
    nothing = np.zeros(0)
    recordings = ShotRecordings(
        time=nothing, value=nothing, unit="V", baseline=None, zero=0.0, window=(0.0, 1e-3), symmetry_end=None,
        motion=SimpleNamespace(is_velocity=False),
    )  # fmt: skip
    write_identify_page(folder, RESULTS["one"], recordings, ("svg", "csv"))  # what `--figures svg,csv` does
    assert 'id="peak-force"' in (folder / PAGE).read_text(encoding="utf-8")
    assert (folder / "figures" / "peak-force.svg").stat().st_size > 0
    rows = rows_of(folder / "figures" / "peak-force.csv")
    c = RESULTS["one"].comparison
    assert [(row["series"], row["y axis"]) for row in rows] == [
        ("measured", "Force $F$ (N)"),
        ("simulated", "Force $F$ (N)"),
    ]
    largest = [c.force_measured.max(), c.force_model.max()]
    np.testing.assert_allclose([float(row["y"]) for row in rows], largest, rtol=1e-8)  # nine digits


def test_it_gets_into_the_index_of_modules(made_up: Path) -> None:
    pages = module_at(ROOT / "docs" / "_ext" / "module_pages.py")
    package = made_up.parent / "__init__.py"
    package.write_text('"""Figures."""\n', encoding="utf-8")
    text = pages.page(pages.Source("figures", package), ())
    assert "``figures.peak_force``\n   Figure of the largest force: measured and simulated." in text


def test_two_figures_of_one_name_are_refused(made_up: Path) -> None:
    kind = module_at(made_up, "peak_force").peak_force
    with pytest.raises(ValueError, match="two figures of one page are called 'peak-force'"):
        by_name([kind, kind])


def test_every_registry_has_figures_and_another_name_has_none() -> None:
    for name in figures.PLACES:
        registry = getattr(figures, name)
        assert registry
        assert registry is getattr(figures, name)  # loaded once
        assert all(kind.name == key for key, kind in registry.items())
    assert set(figures.PLACES) == set(figures.__all__) - {"SHOWN_BY", "FigureKind", "figures_of"}
    assert set(figures.SHOWN_BY.values()) <= set(figures.PLACES)
    with pytest.raises(AttributeError, match="has no attribute 'PAINTINGS'"):
        _ = figures.PAINTINGS


def test_a_page_loads_its_own_figures_and_a_terminal_no_identification() -> None:
    code = (
        "import sys, kolsky.cli.terminal; "
        "print([n for n in sys.modules if n.startswith(('kolsky.diagnosis', 'kolsky.uncertainty'))]); "
        "import kolsky.report.pages.surfaces; from kolsky.report.figures import SURFACES; "
        "print(*sorted(name[22:] for name in sys.modules if name.startswith('kolsky.report.figures.')))"
    )
    run = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    terminal, page = run.stdout.splitlines()
    assert terminal == "[]"
    assert {"base", "surfaces"} <= set(page.split())
    assert not {"studies", "planning", "misfit"} & set(page.split())
