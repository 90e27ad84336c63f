"""Constants from a specimen with rubbing ends: the thesis' silicone, and `kolsky material fit --specimen`."""

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from explicit.materials import LAWS, bulk_modulus
from kolsky.base.apparatus import Specimen
from kolsky.cli import app
from kolsky.material.compression.march import compress
from kolsky.material.compression.mesh import HalfCylinder
from kolsky.material.curves.band import CurveBand
from kolsky.material.end_friction.problem import CorrectionNumerics, EndFriction
from kolsky.material.end_friction.specimen_fit import fit_specimen

REFERENCE = Path(__file__).resolve().parents[2] / "reference"
C10, C20, POISSON = 1404.9, 699.4, 0.495
"""Table 3.3 of the thesis: 80 mm by 70 mm, 10 mm of compression, f = 0.7."""


@pytest.mark.slow
def test_planted_constants_of_a_rubbing_silicone_are_found():
    strain = np.linspace(0.01, 10.0 / 70.0, 20)
    made = compress(
        [LAWS["reduced_polynomial"](C10, C20)], HalfCylinder(0.04, 0.035, 16, 14), strain,
        bulk=float(bulk_modulus(2.0 * C10, POISSON)), modulus=2.0 * C10, bonded=False, friction=0.7,
    )  # fmt: skip
    band = CurveBand(strain, made.stress, np.zeros(20), np.empty((0, 20)), ())
    size, ends = Specimen(diameter=0.08, length=0.07, density=0.0), EndFriction("coulomb", 0.7)
    (found,) = fit_specimen(
        band, size, ends, ("reduced_polynomial",), numerics=CorrectionNumerics(poisson=POISSON)
    )
    # A mesh that the fit does not use: what is left is the mesh's.
    assert found.constants["C10"] == pytest.approx(C10, rel=5e-4)
    assert found.constants["C20"] == pytest.approx(C20, rel=5e-3)
    assert abs(found.constants["C20"] - C20) < 2.0 * found.sigma["C20"]
    assert found.correlation[0, 1] < -0.5


@pytest.mark.slow
def test_the_command_fits_another_programs_specimen(tmp_path):
    lines = [line.split(",") for line in (REFERENCE / "H_force.csv").read_text().splitlines()[1:]]
    rows = [row for row in lines if row[0] == "reduced_polynomial"]
    text = "".join(f"{70.0 * float(row[2])},{row[3]}\n" for row in rows)
    (tmp_path / "push.csv").write_text("Travel (mm),Load (N)\n" + text, encoding="utf-8")
    done = CliRunner().invoke(
        app,
        ["material", "fit", str(tmp_path / "push.csv"), "--displacement", "Travel", "--force", "Load",
         "--length", "70 mm", "--diameter", "80 mm", "--convention", "compression-positive",
         "--poisson", "0.495",
         "--specimen", "80 mm x 70 mm", "--ends", "0.7", "--laws", "reduced_polynomial", "--out",
         str(tmp_path / "out"), "--json"],
    )  # fmt: skip
    assert done.exit_code == 0, done.output
    (law,) = json.loads(done.stdout)["laws"]
    # GetFEM on 12 elements: its force is known to a few tenths of a per cent.
    assert law["constants"]["C10"] == pytest.approx(C10, rel=0.01)
    assert (tmp_path / "out" / "specimen_constants.csv").exists()
