"""The bend of the whole actuator beside DOLFINx's on the same tetrahedra, `tests/reference/K_dolfinx.py`."""

import csv
from pathlib import Path

import numpy as np
import pytest

from kolsky.bodies.actuator_reading import read_actuator

ROOT = Path(__file__).resolve().parents[3]


@pytest.mark.slow
@pytest.mark.parametrize("gravity", ["downward", "upward"])
def test_bend_is_that_of_dolfinx(gravity: str) -> None:
    read = read_actuator(ROOT / "runs" / "actuator" / "pneunet.toml")
    with (ROOT / "tests" / "reference" / "K_pneunet.csv").open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["gravity"] == gravity]
    pressures = sorted({float(row["pressure (Pa)"]) for row in rows})
    assert pressures[1:] == pytest.approx([30e3, 50e3, 76e3])
    run = read.actuator.simulate(read.gravities[gravity], np.array(pressures))
    mesh = read.actuator.mesh
    for step, pressure in enumerate(pressures):
        own = [row for row in rows if float(row["pressure (Pa)"]) == pressure]
        theirs = np.array([[float(row[f"{axis} (m)"]) for axis in "xyz"] for row in own])
        nodes = np.array([int(row["node"]) for row in own])
        ours = mesh.points[nodes] + run.solution.displacements[step, nodes]
        # the same elements and points of quadrature: what both iterations leave, some 1e-8 of the length
        assert np.abs(ours - theirs).max() < 1e-7 * np.ptp(mesh.points[:, 0])
        chord = theirs[-1] - theirs[0]
        assert run.angle[step] == pytest.approx(np.arctan2(-chord[2], chord[0]), rel=1e-6)
