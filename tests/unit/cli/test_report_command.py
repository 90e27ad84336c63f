"""`kolsky report`: a new page from the result and the shot's files, with texts of any origin."""

import re
from dataclasses import replace
from html import unescape
from pathlib import Path

import h5py
import numpy as np
import pytest
from html_pages import Page
from kolsky_command import run_kolsky
from shot_folders import shot_in
from synthetic import synthetic
from typer.testing import CliRunner

from explicit import Response
from kolsky.cli import app
from kolsky.inverse.result import Declaration, Method, ParameterProfile
from kolsky.report.pages.identification import render
from kolsky.report.pages.rendering import HEADING, LONGEST, printable_text
from kolsky.results import numbers
from kolsky.results.hdf5 import write_identification
from kolsky.shot.load import load_shot
from kolsky.shot.recordings import recording_facts

runner = CliRunner()
EVIL = "<script>alert(1)</script>"


@pytest.fixture
def no_old_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """The figures of the result have tests of their own, and take most of a page's time."""
    monkeypatch.setattr("kolsky.report.pages.identification.REGISTRY", {})


def identified(folder: Path, **changed: object) -> None:
    """A result in the shot's folder that belongs to its files; the numbers are made up."""
    loaded = load_shot(folder)
    made = synthetic(shot=loaded.name)
    provenance = {
        **made.provenance,
        "inputs": dict(loaded.inputs),
        "recordings": recording_facts(loaded),
        **changed,
    }
    (folder / "results").mkdir(exist_ok=True)
    write_identification(folder / "results" / "identification.h5", replace(made, provenance=provenance))


# The command


@pytest.mark.usefixtures("no_old_figures")
def test_the_page_again_without_a_simulation(shot: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def never(*_: object, **__: object) -> Response:
        raise AssertionError("a simulation")

    monkeypatch.setattr("explicit.run", never)
    monkeypatch.setattr("kolsky.inverse.forward.Forward.run", never)
    identified(shot)
    run_kolsky("report", shot, "--figures", "csv", "--json")
    written = {str(path.relative_to(shot / "results")) for path in (shot / "results").rglob("*.*")}
    assert {"report.html", "figures/raw-signals.csv", "figures/flyer-path.csv"} <= written
    html = (shot / "results" / "report.html").read_text(encoding="utf-8")
    assert 'id="raw-signals"' in html
    assert 'id="flyer-path"' in html
    first = html
    assert runner.invoke(app, ["report", str(shot)]).exit_code == 0
    assert (shot / "results" / "report.html").read_text(encoding="utf-8") == first


def test_a_result_of_other_files_is_refused(shot: Path) -> None:
    identified(shot)
    with (shot / "flyer.csv").open("a", encoding="utf-8") as file:
        file.write("\n")
    result = run_kolsky("report", shot, code=2)
    assert "made from other files than those of the shot: flyer.csv" in result.stderr
    assert not (shot / "results" / "report.html").exists()


def test_a_shot_without_a_result_is_refused(tmp_path: Path) -> None:
    result = run_kolsky("report", shot_in(tmp_path / "shot"), code=2)
    assert "identification.h5" in result.stderr
    assert "kolsky identify" in result.stderr


@pytest.mark.parametrize(
    "name", [EVIL, "../../x", "x" * 10_000, "a\\u202eb"], ids=["tag", "path", "long", "right-to-left"]
)
@pytest.mark.usefixtures("no_old_figures")
def test_a_hostile_name_is_escaped_and_confined(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("kolsky.report.pages.identification.RECORDINGS", {})  # they show no name
    (tmp_path / "a" / "b").mkdir(parents=True)  # two folders up from the shot is still the test's own
    folder = shot_in(tmp_path / "a" / "b" / "shot")
    file = folder / "shot.toml"
    text = file.read_text(encoding="utf-8")
    file.write_text(text.replace("format = 1\n", f'format = 1\nname = "{name}"\n', 1), encoding="utf-8")
    identified(folder)
    before = outside(tmp_path, folder / "results")
    run_kolsky("report", folder)
    assert outside(tmp_path, folder / "results") == before
    html = (folder / "results" / "report.html").read_text(encoding="utf-8")
    assert "<script>alert" not in html
    assert "\u202e" not in html
    heading = re.search(r"<h1>(.*?)</h1>", html)
    assert len(unescape(heading[1])) <= HEADING
    with h5py.File(folder / "results" / "identification.h5") as kept:
        assert kept["entry/shot"][()].decode() == name.replace("\\u202e", "\u202e")


def outside(root: Path, results: Path) -> set[Path]:
    return {path for path in root.rglob("*") if path != results and results not in path.parents}


@pytest.mark.usefixtures("no_old_figures")
def test_metadata_with_control_characters() -> None:
    strange = {"a\x00b": "c\x1bd", EVIL: "y" * 10_000}
    html = render(replace(synthetic(), provenance={"inputs": strange}))
    assert not re.search(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]", html)
    assert EVIL not in html
    assert "y" * LONGEST not in html
    assert printable_text("a\x07\u202eb") == "a□□b"
    assert printable_text("Φ = 1 µm\n") == "Φ = 1 µm\n"


# The numbers on the page are those in the file


@pytest.mark.usefixtures("no_old_figures")
def test_every_number_is_in_the_file(tmp_path: Path) -> None:
    profile = ParameterProfile(
        name="stiffness_factor", values=np.array([1.11, 1.12, 1.13]), rise=np.array([9.0, 0.0, 9.0]),
        points=np.array([[1.11], [1.12], [1.13]]), level=3.84, correlation=1.0, interval=(1.1163, 1.1238),
        alone=(1.1163, 1.1238), verdict="identified",
        text="stiffness_factor is identified, between 1.1163 and 1.1238", error=0.01,
    )  # fmt: skip
    moved = Declaration(
        key="poisson", sigma=0.004, unit="1", shifts={"stiffness_factor": 0.0014}, status="varied"
    )
    way = Method(
        name="surrogate and least squares", values={"stiffness_factor": 1.1203},
        distances={"stiffness_factor": 0.06}, runs=17, shared_runs=3, converged=True, ended="at rest",
    )  # fmt: skip
    ways = (way, replace(way, name="profile likelihood"))
    made = replace(synthetic(), profiles=(profile,), systematic=(moved,), methods=ways)
    e = replace(made.estimates["stiffness_factor"], sigma_systematic=0.0014)
    made = replace(made, estimates={"stiffness_factor": e})
    path = tmp_path / "identification.h5"
    write_identification(path, made)
    text = " ".join(Page(render(made)).text.split())
    with h5py.File(path) as file:
        entry = file["entry"]
        m = entry["estimates/stiffness_factor"]
        value, *sigmas = (float(m[key][()]) for key in ("value", "sigma_noise", "sigma_numerical"))
        systematic = float(m["sigma_systematic"][()])
        U = 2.0 * float(np.sqrt(sum(s**2 for s in (*sigmas, systematic))))
        assert "{} ± {}".format(*numbers.measured(value, U)) in text
        for part in (*sigmas, systematic, *m["noise_parts/values"][()]):
            assert f" {numbers.part(part, U)} " in text
        assert f" {numbers.plain(float(m['mesh_shift'][()]), 2)} " in text
        terms = entry["terms"]
        for key in ("phi_force", "phi", "chi2_force", "chi2_shape"):
            assert f" {numbers.plain(float(terms[key][()]))} " in text
        for key in ("n_force", "n_shape"):
            assert f" {int(terms[key][()])} " in text
        for key in (name for name in entry["routes"] if name.isdigit()):
            route = entry["routes"][key]
            assert numbers.plain(float(route["cost"][()])) in text
            assert numbers.like(float(route["parameters/values"][0]), 2.0 * sigma_of(route, U)) in text
        quality = dict(zip(entry["surrogate/names"].asstr()[()], entry["surrogate/values"][()], strict=True))
        for key, (factor, digits) in SHOWN_QUALITY.items():
            assert f" {numbers.plain(factor * float(quality[key]), digits)} " in text
        known = entry["knowledge"]
        for end in (*known["profiles/0/interval"][()], *known["profiles/0/alone"][()]):
            assert f" {end:.4f} " in text
        assert f" {known['systematic/0/sigma'][()]:.3f} " in text
        assert f" {known['systematic/0/shifts/values'][0]:.4f} " in text
        method = entry["methods/0"]
        assert f" {int(method['runs'][()])} " in text
        assert f"{numbers.like(float(method['values/values'][0]), U)} (" in text


def sigma_of(route: h5py.Group, U: float) -> float:
    """Standard uncertainty of a route's optimum, half the answer's U where it has none."""
    values = route["sigma/values"][()]
    return float(values[0]) if values.size else 0.5 * U


SHOWN_QUALITY = {"loo_force": (1.0, 2), "loo_shape": (1e6, 2), "counted_points": (1.0, 6)}
"""Factor and digits of some entries on the page."""
