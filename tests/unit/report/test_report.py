"""Report of an identification: labelled figures, a self-contained page, names and units of its tables."""

import csv
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import pyvista
from figure_overlaps import overlaps
from html_pages import Page
from matplotlib.axis import Axis
from synthetic import EVIL, N_AXIAL, N_RADIAL, RESULTS

import kolsky.report.canvas
from explicit.materials.laws.marlow import neo_hookean
from explicit.materials.volumetric import VolumetricLaw
from explicit.mesh import Mesh, cylinder
from kolsky.base.records import CentreLine
from kolsky.inverse.parameters import PARAMETERS
from kolsky.inverse.result import Identification, Verdict
from kolsky.report.canvas import build, inline_svg, save_figures, write_data
from kolsky.report.figures import REGISTRY
from kolsky.report.figures.comparison import cells, chosen_frames
from kolsky.report.pages.identification import _flattened, render, write_report
from kolsky.report.paraview import write_vtu
from kolsky.report.scene.scene_data import Solid
from kolsky.results.display import QUALITY, in_display_units, recorded_label
from kolsky.results.nomenclature import name_of

ROOT = Path(__file__).parents[3]


# Figures: a new one of the registry gets all of this


def _shows_numbers(axis: Axis) -> bool:
    shown = axis.get_tick_params(which="major")
    sides = ("labelleft", "labelright", "labelbottom", "labeltop")
    return len(axis.get_majorticklocs()) > 0 and any(shown.get(side, False) for side in sides)


@pytest.mark.parametrize("which", RESULTS)
@pytest.mark.parametrize("name", REGISTRY)
def test_figure_has_labelled_axes_with_units_and_its_data(name: str, which: str, tmp_path: Path) -> None:
    kind, result = REGISTRY[name], RESULTS[which]
    if not kind.applies(result):
        pytest.skip("nothing to draw")
    figure = build(kind, result)
    for ax in figure.axes:
        for axis in (ax.xaxis, ax.yaxis):
            if _shows_numbers(axis):
                assert re.fullmatch(r".+ \([^()]+\)", axis.get_label_text()), axis.get_label_text()
        assert ax.get_title() == ""
    assert overlaps(figure) == []
    with write_data(tmp_path / "data.csv", figure).open(encoding="utf-8", newline="") as file:
        panels = {row["panel"] for row in csv.DictReader(file)}
    named = {ax.get_label() for ax in figure.axes} - {"<colorbar>"}
    assert panels == named or (which == "failed" and panels < named)  # where no simulation completed
    assert kind.width in (85.0, 170.0)  # a journal's column and page, mm
    assert kind.caption(result).endswith(".")
    assert re.fullmatch(r"[a-z][a-z-]*", kind.name)


def test_no_figure_of_data_that_are_not_there() -> None:
    none, whole = np.zeros(0), RESULTS["one"].comparison
    line = CentreLine(time=none, frame=none.astype(np.int64), y=none, Z=none, sigma=none)
    bins = {name: none for name in ("force_time", "force_measured", "force_sigma", "force_model")}
    bare = replace(whole, **bins, centre_line=line, Z_model=none, inside=none.astype(bool))
    result = replace(RESULTS["one"], comparison=bare)
    shown = {name for name, kind in REGISTRY.items() if kind.applies(result)}
    assert shown == {"misfit", "energy"}
    for name in shown:
        build(REGISTRY[name], result)


def test_saved_figures(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("kolsky.report.figures.REGISTRY", {"force": REGISTRY["force"]})
    paths = save_figures(tmp_path / "a", RESULTS["one"])
    assert [p.name for p in paths] == ["force.pdf", "force.svg", "force.png", "force.csv"]
    assert paths[0].read_bytes().startswith(b"%PDF")
    assert paths[2].read_bytes().startswith(b"\x89PNG")
    width = ElementTree.parse(paths[1]).getroot().attrib["width"]
    assert float(width.removesuffix("pt")) == pytest.approx(85.0 * 72.0 / 25.4)  # 85 mm in points
    again = save_figures(tmp_path / "b", RESULTS["one"], formats=["svg"])
    assert again[0].read_bytes() == paths[1].read_bytes()  # the same result, the same bytes
    with pytest.raises(ValueError, match="'gif' is not one of pdf, svg, png, csv"):
        save_figures(tmp_path / "c", RESULTS["one"], formats=["gif"])
    assert not (tmp_path / "c").exists()


def test_no_figures_are_loaded_before_a_report_is_written() -> None:
    code = (
        "import sys, kolsky.report, kolsky.results.printed; "
        "print({'matplotlib', 'pyvista'} & set(sys.modules))"
    )
    run = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert run.stdout == "set()\n"


def test_no_global_plotting_state() -> None:
    folder = Path(kolsky.report.canvas.__file__).parent
    for source in folder.rglob("*.py"):
        assert "pyplot" not in source.read_text(encoding="utf-8"), source


def test_map_cells_end_half_way_to_their_neighbours() -> None:
    # Two frames 2 apart; heights 1, 2, 4 (not sorted) and one lone point at 5.
    time, frame = np.array([0.0, 0.0, 0.0, 2.0]), np.array([7, 7, 7, 8])
    corners = cells(time, frame, np.array([2.0, 1.0, 4.0, 5.0]))
    np.testing.assert_array_equal(corners[0], [[-1, 1.5], [1, 1.5], [1, 3], [-1, 3]])
    np.testing.assert_array_equal(corners[1], [[-1, 0.5], [1, 0.5], [1, 1.5], [-1, 1.5]])
    np.testing.assert_array_equal(corners[2], [[-1, 3], [1, 3], [1, 5], [-1, 5]])
    np.testing.assert_array_equal(corners[3], [[1, 4.75], [3, 4.75], [3, 5.25], [1, 5.25]])


def test_six_frames_at_equal_distances() -> None:
    # 186 frames, the last one included: steps of 185/6 = 30.83 frames, rounded.
    np.testing.assert_array_equal(chosen_frames(RESULTS["one"]), [31, 62, 92, 123, 154, 185])


# Page


@pytest.fixture(scope="module")
def html() -> str:
    files = {"<img src=x onerror=alert(1)>.csv": "ab" * 32}
    return render(replace(RESULTS["two"], provenance={**RESULTS["two"].provenance, "inputs": files}))


def test_page_is_whole_in_itself(html: str) -> None:
    page = Page(html)
    assert not page.tags & {"link", "img", "image", "iframe", "object", "embed", "base", "form"}
    assert page.loads == []
    assert "://" not in html
    assert "@import" not in html
    assert "default-src 'none'" in html  # a browser would refuse to load anything anyway
    assert html.count("<script") == 1  # it opens sections: see test_page_policy


def test_page_ids_are_unique_and_references_resolve(html: str) -> None:
    page = Page(html)
    assert len(page.ids) == len(set(page.ids))
    assert set(page.references) <= set(page.ids)
    assert len(page.references) > 100  # glyphs and clip paths are referred to, so the check above bites


def test_names_are_escaped(html: str) -> None:
    assert EVIL not in html
    assert "&lt;b&gt;x&lt;/b&gt;" in html
    assert "<img" not in html
    assert "&lt;img src=x onerror=alert(1)&gt;.csv" in html


def test_page_says_the_answer_first_and_rounds(html: str) -> None:
    text = " ".join(Page(html).text.split())
    # u = hypot(0.0019, 0.0016) = 0.002484, so U = 0.0050 and the interval is 1.1150 to 1.1250.
    assert "m = 1.1200 ± 0.0050 ( k = 2)" in text
    assert "Interval 1.1150 to 1.1250" in text
    assert text.index("1.1200 ± 0.0050") < text.index("What was tested")
    assert "Before using these values: The made-up specimen does not exist (nominal strain −0.8)." in text
    assert text.index("1.1200 ± 0.0050") < text.index("nor does its flyer".capitalize())
    assert "m on the refined mesh minus on the surrogate’s −0.0058" in text
    words_of_it = ("Noise, all sources", "Mesh and step", "Force χ² only", "inverted", "16 × 22")
    for words in (*words_of_it, "24 × 33"):
        assert words in text
    assert "ab" * 32 in text
    assert not re.findall(r"\d\.\d{7,}", text)  # no unrounded number


def test_the_first_screen_and_the_folds(html: str) -> None:
    first, _, rest = html.partition('<nav aria-label="Contents">')
    contents, _, rest = rest.partition("</nav>")
    assert re.findall(r"<figure[^>]*id=\"([a-z-]*)\"", first) == ["force", "outline"]
    text = " ".join(Page(first).text.split())
    for words in (
        "Fit of the force: explained",
        "Fit of the outline: explained",
        "To narrow the interval: Halving ",
        "read 2 warnings",
    ):
        assert words in text
    # Noise 0.0019 and mesh 0.0016: 59 and 41 % of their sum of squares.
    assert "What dominates the variance of m : noise 59 %, mesh and step 41 %." in text
    folds = re.findall(r'<details class="fold" id="([a-z-]+)"( open)?>', rest)
    assert [name for name, _ in folds] == re.findall(r'href="#([a-z-]+)"', contents)
    assert folds[0] == ("budget", "")
    assert {name for name, opened in folds if opened} <= {"causes"}
    numbers = [int(number) for number in re.findall(r"<b>Figure (\d+)\.</b>", html)]
    assert numbers == list(range(1, len(numbers) + 1))  # in the order of the page


def test_page_without_warnings_has_no_banner(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("kolsky.report.pages.identification.REGISTRY", {})
    assert "Before using" not in render(replace(RESULTS["one"], warnings=()))
    text = " ".join(Page(render(RESULTS["damping"])).text.split())
    assert "β = 25.00 ± 0.82 µs" in text  # U = 2 hypot(0.4, 0.1) = 0.825
    assert "flyer fit, χ² per degree of freedom 0.97" in text


def test_friction_that_is_not_used_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("kolsky.report.pages.identification.REGISTRY", {})
    result = RESULTS["one"]
    assert "not used: nothing slides" in render(result)
    sliding = {**result.provenance, "interface": {"faces": "coulomb", "side": "rough"}}
    assert "not used" not in render(replace(result, provenance=sliding))


def test_page_of_a_failed_search_says_so() -> None:
    text = " ".join(Page(render(RESULTS["failed"])).text.split())
    assert "no estimate" in text
    assert "No simulation of the design completed" in text
    assert "nan" not in text.lower().replace("provenance", "")


@pytest.mark.parametrize("verdict", Verdict)
def test_every_verdict_is_explained(verdict: Verdict, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("kolsky.report.pages.identification.REGISTRY", {})  # words only
    result = RESULTS["one"]
    estimate = replace(result.estimates["stiffness_factor"], outcome=verdict, sigma_noise=float("inf"))
    html = render(replace(result, estimates={"stiffness_factor": estimate}))
    assert f"{verdict.value[:1].upper()}{verdict.value[1:]}." in html
    assert ('class="answer good"' in html) == (verdict is Verdict.IDENTIFIED)
    assert "1.12, not bounded by the data" in html


def test_parts_that_do_not_add_up_are_mentioned(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("kolsky.report.pages.identification.REGISTRY", {})
    result = RESULTS["one"]
    estimate = replace(result.estimates["stiffness_factor"], noise_parts={"force and shape": 0.5})
    assert "do not add up" in render(replace(result, estimates={"stiffness_factor": estimate}))
    assert "do not add up" not in render(result)


def test_written_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("kolsky.report.pages.identification.REGISTRY", {})
    path = tmp_path / "report.html"
    write_report(path, replace(RESULTS["one"], provenance={"inputs": {"a\udcff.csv": "0"}}))
    assert "a\\udcff.csv" in path.read_text(encoding="utf-8")  # a file name that is no text
    before = path.read_bytes()
    with pytest.raises(AttributeError):
        write_report(path, replace(RESULTS["one"], shot=None, comparison=None))
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["report.html"]


def test_provenance_is_flattened_and_kept_whole() -> None:
    nested = {"a": {"b": 1.0 / 3.0, "c": [1, 2]}, "d": True, "e": [{"f": None}], "g": "x"}
    assert _flattened(nested) == [
        ("a.b", "0.333333"),
        ("a.c", "1, 2"),
        ("d", "yes"),
        ("e[0].f", "default"),
        ("g", "x"),
    ]
    assert _flattened({"window_s": [0.0, 1.5e-3]}) == [("simulated window", "0 to 1.5 ms")]
    settings = {"free": {"friction": None, "damping": [0.0, 1e-4]}, "refined_mesh": [48, 64]}
    assert _flattened(settings) == [
        ("free: Coulomb friction between specimen and platens f", "default bounds"),
        ("free: stiffness-proportional damping β", "0 to 100 µs"),
        ("refined mesh", "48 × 64"),
    ]


def test_every_parameter_has_a_name_and_its_unit() -> None:
    for p in PARAMETERS.values():
        name = name_of(p.name)
        assert name.words != p.name.replace("_", " ")
        # The shown unit is the SI unit but for its prefix, which the factor takes into account.
        assert (name.unit, name.factor) in ((p.unit, 1.0), (f"µ{p.unit}", 1e6), (f"k{p.unit}", 1e-3))


def test_every_check_and_quality_has_words() -> None:
    result = RESULTS["one"]
    assert not [key for key in result.provenance["checks"] if recorded_label(key) == key]
    assert set(result.surrogate) <= set(QUALITY)


def test_shown_units_are_those_of_a_reader() -> None:
    shown = in_display_units(RESULTS["damping"])
    e = shown.estimates["damping"]
    assert (e.unit, e.value, e.sigma_noise) == ("µs", pytest.approx(25.0), pytest.approx(0.4))
    assert e.sigma == pytest.approx(np.hypot(0.4, 0.1))
    assert shown.design.upper[1] == pytest.approx(100.0)
    assert shown.curves[1].x.mean() == pytest.approx(25.0)
    assert shown.routes[0].parameters["damping"] == pytest.approx(25.0)
    np.testing.assert_array_equal(shown.design.points[:, 0], RESULTS["damping"].design.points[:, 0])
    assert in_display_units(RESULTS["one"]).fixed["damping"] == pytest.approx(25.0)


def test_inline_figure_is_well_formed_and_named() -> None:
    root = ElementTree.fromstring(inline_svg(build(REGISTRY["energy"], RESULTS["one"]), "energy"))
    assert root.tag == "svg"
    assert all(e.attrib.get("id", "energy-").startswith("energy-") for e in root.iter())


# Meshes for ParaView


@pytest.fixture
def meshed() -> tuple[Identification, Mesh]:
    return RESULTS["one"], cylinder(1.0, 1.0, n_radial=N_RADIAL, n_axial=N_AXIAL)


def test_vtu_series_reads_back(meshed: tuple[Identification, Mesh], tmp_path: Path) -> None:
    result, mesh = meshed
    nodes = result.response.nodes
    assert nodes is not None
    paths = write_vtu(tmp_path / "m", result.response, mesh, None, every=60)
    assert [p.name for p in paths] == [*(f"mesh_{k:05d}.vtu" for k in (0, 60, 120, 180)), "mesh.pvd"]
    reader = pyvista.get_reader(paths[-1])
    np.testing.assert_array_equal(reader.time_values, result.response.surface_times[::60])
    grid = pyvista.read(paths[2])
    assert grid.n_cells == N_RADIAL * N_AXIAL
    np.testing.assert_array_equal(grid.points[:, :2], nodes[0, 120])
    np.testing.assert_array_equal(grid.point_data["displacement [m]"][:, :2], nodes[0, 120] - nodes[0, 0])
    # The half-section's area: the cells' areas sum to that inside the outline (trapezoids between rows).
    r, y = result.response.surface_r[0, 120], result.response.surface_y[0, 120]
    area = grid.compute_cell_sizes()["Area"].sum()
    assert area == pytest.approx(np.trapezoid(r, y), rel=1e-9)  # straight edges: exact but for round-off


def test_vtu_carries_the_fields_of_films(tmp_path: Path) -> None:
    # Compressed to 0.8 without a change of volume, by hand: stretches, no pressure, von Mises as the
    # difference of two principal stresses of a neo-Hookean solid.
    mesh = cylinder(1.0, 1.0, n_radial=2, n_axial=2)
    response = replace(
        RESULTS["one"].response,
        nodes=np.stack([mesh.nodes, mesh.nodes * [0.8**-0.5, 0.8]])[None],
        surface_times=np.array([0.0, 1e-3]),
    )
    write_vtu(tmp_path, response, mesh, Solid(neo_hookean(1e5), VolumetricLaw(1e7), 1.1))
    fields = pyvista.read(tmp_path / "mesh_00001.vtu").point_data
    np.testing.assert_allclose(fields["Smallest stretch (1)"], 0.8)
    np.testing.assert_allclose(fields["Pressure (MPa)"], 0.0, atol=1e-10)  # round-off of K (J - 1)
    # The law is a table of 129 knots: its stress is good to 1e-4.
    np.testing.assert_allclose(fields["Von Mises stress (MPa)"], 0.11 * (1.0 / 0.8 - 0.64), rtol=1e-3)


def test_vtu_series_ends_with_the_simulation(meshed: tuple[Identification, Mesh], tmp_path: Path) -> None:
    result, mesh = meshed
    nodes = result.response.nodes.copy()
    nodes[:, 2:] = np.nan
    assert len(write_vtu(tmp_path, replace(result.response, nodes=nodes), mesh, None)) == 3


def test_vtu_refuses_what_it_cannot_write(meshed: tuple[Identification, Mesh], tmp_path: Path) -> None:
    result, mesh = meshed
    with pytest.raises(ValueError, match="kept no nodes"):
        write_vtu(tmp_path, replace(result.response, nodes=None), mesh, None)
    with pytest.raises(ValueError, match="every must be >= 1, got 0"):
        write_vtu(tmp_path, result.response, mesh, None, every=0)
    with pytest.raises(ValueError, match="the mesh has 9 nodes, the response 850"):
        write_vtu(tmp_path, result.response, cylinder(1.0, 1.0, n_radial=2, n_axial=2), None)
    assert list(tmp_path.iterdir()) == []
