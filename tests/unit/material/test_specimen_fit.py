"""Constants from a specimen with friction at its ends: the thesis' silicone, and `kolsky material fit
--specimen`."""

from pathlib import Path

import numpy as np
import pytest
from kolsky_command import json_of, run_kolsky

from kolsky.material.end_friction import correct
from kolsky.material.end_friction.problem import ModelFit
from kolsky.material.uniaxial import noise_about_curve

REFERENCE = Path(__file__).resolve().parents[2] / "reference"
C10, C20 = 1404.9, 699.4
"""Table 3.3 of the thesis: 80 mm by 70 mm, 10 mm of compression, f = 0.7."""


@pytest.mark.slow
def test_the_command_finds_the_thesis_constants_in_another_programs_force(tmp_path):
    lines = [line.split(",") for line in (REFERENCE / "I_force.csv").read_text().splitlines()]
    rows = [row for row in lines if row[0] == "reduced_polynomial"]
    text = "".join(f"{70.0 * float(row[2])},{row[3]}\n" for row in rows)
    (tmp_path / "push.csv").write_text("Travel (mm),Load (N)\n" + text, encoding="utf-8")
    columns = ["--displacement", "Travel", "--force", "Load", "--convention", "compression-positive"]
    size = ["--specimen", "80 mm x 70 mm", "--poisson", "0.495", "--ends", "0.7"]
    words = [*columns, *size, "--laws", "reduced_polynomial", "--out", tmp_path / "out"]
    (law,) = json_of("material", "fit", tmp_path / "push.csv", *words)["laws"]
    # DOLFINx, two meshes that agree within 0.01 %; what is left is the mesh's here.
    assert law["constants"]["C10"] == pytest.approx(C10, rel=5e-4)
    assert law["constants"]["C20"] == pytest.approx(C20, rel=5e-3)
    assert abs(law["constants"]["C20"] - C20) < 2.0 * law["sigma"]["C20"]
    assert law["correlation"][0][1] < -0.5
    assert (tmp_path / "out" / "specimen_constants.csv").exists()


def test_noise_of_few_readings_holds_no_bend():
    """A curve of the fifth order has none; readings that lie a to either side in turn have second differences
    of 2 a over the root of 1.5, whose median stands for 0.6745 standard deviations."""
    strain = np.linspace(0.01, 0.3, 30)
    curve = 1e4 * (strain + 3.0 * strain**2 + 20.0 * strain**5)
    np.testing.assert_allclose(noise_about_curve(strain, curve, strain), 0.0, atol=1e-9)
    turn = np.where(np.arange(30) % 2, 1.0, -1.0)
    one = 2.0 / np.sqrt(1.5) / 0.674490
    equal = noise_about_curve(strain[::-1], (curve + 5.0 * turn)[::-1], strain)
    assert equal[0] == pytest.approx(5.0 * one, rel=0.02)
    proportional = noise_about_curve(strain, curve * (1.0 + 2e-3 * turn), strain)
    assert proportional[-1] == pytest.approx(2e-3 * one * curve[-1], rel=0.05)


def test_few_readings_are_compared_where_they_are_and_what_they_leave_open_is_named(tmp_path, monkeypatch):
    travel = np.arange(1, 21) * 0.5
    force = 0.3 * travel + 0.05 * travel**2
    rows = "".join(f"{x},{y}\n" for x, y in zip(travel, force, strict=True))
    (tmp_path / "push.csv").write_text("Travel (mm),Load (N)\n0,0\n" + rows, encoding="utf-8")
    bands = []

    def fitted(band, *_, **__):
        bands.append(band)
        constants, sigma = {"C10": 1000.0, "C20": 90.0}, {"C10": 2.0, "C20": 100.0}
        return (ModelFit("yeoh", constants, sigma, np.eye(2), band.stress, 0.0, 0.0, 1.0),)

    monkeypatch.setattr(correct, "fit_specimen", fitted)
    words = ["material", "fit", tmp_path / "push.csv", "--displacement", "Travel", "--force", "Load"]
    words += ["--convention", "compression-positive", "--specimen", "80 mm x 70 mm", "--ends", "bonded"]
    run = run_kolsky(*words, "--out", tmp_path / "out")
    (band,) = bands
    np.testing.assert_allclose(band.strain, travel / 70.0)
    np.testing.assert_allclose(band.stress, force / (np.pi * 0.04**2), rtol=1e-12)
    assert (band.noise < 1e-6 * band.stress).all()
    assert "C10 = 1000 ± 4 (SI, k = 2)" in run.stdout
    assert "C20 is not determined by this test: -110 to 290 (SI, k = 2)" in run.stdout
    table = (tmp_path / "out" / "specimen_constants.csv").read_text(encoding="utf-8")
    assert [line.split(",")[4] for line in table.splitlines()[1:]] == ["yes", "no"]
