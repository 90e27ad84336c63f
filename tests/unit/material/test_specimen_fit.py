"""Constants from a specimen with rubbing ends: the thesis' silicone, and `kolsky material fit --specimen`."""

from pathlib import Path

import pytest
from kolsky_command import json_of

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
