"""Quasi-static tests from their files: signs, units, size of the specimen; when residuals are dependent."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from explicit.materials import LAWS
from kolsky.base.apparatus import Specimen
from kolsky.material.fits.columns import Columns
from kolsky.material.fits.homogeneous import Mode, incompressible_stress
from kolsky.material.fits.homogeneous_test import (
    HomogeneousTest,
    means_by_mode,
    read_homogeneous_test,
    with_unique_names,
)
from kolsky.material.fits.tables import remarks
from kolsky.material.reference_curve import read_uniaxial_test

SPECIMEN = Specimen(diameter=10e-3, length=5e-3, density=0.0)
AREA = np.pi * (5e-3) ** 2


def machine(path: Path, sign: float) -> Path:
    """Travel [mm] and load [N] of a machine: 1 mm is a strain of 0.2 and 10 N are 127 kPa here."""
    rows = [f"{sign * 0.25 * i:.2f},{sign * 2.5 * i:.1f}" for i in range(9)]
    path.write_text("\n".join(["Travel (mm),Load (N)", *rows]) + "\n")
    return path


@pytest.mark.parametrize(
    ("sign", "convention", "branch"),
    [
        (1.0, "compression-positive", "compression"),
        (-1.0, "tension-positive", "compression"),
        (1.0, "tension-positive", "tension"),
        (-1.0, "compression-positive", "tension"),
    ],
)
def test_a_test_is_positive_along_its_branch(
    tmp_path: Path, sign: float, convention: str, branch: str
) -> None:
    test, sha256 = read_uniaxial_test(
        machine(tmp_path / "a.csv", sign),
        {"displacement": "Travel", "force": "Load"},
        convention=convention,
        branch=branch,
        specimen=SPECIMEN,
    )
    np.testing.assert_allclose(test.strain, 0.05 * np.arange(9), rtol=1e-12)  # 0.25 mm of 5 mm; round-off
    np.testing.assert_allclose(test.stress, 2.5 * np.arange(9) / AREA, rtol=1e-12)
    assert test.compression is (branch == "compression")
    assert len(sha256) == 64


def test_a_homogeneous_test_is_positive_in_tension(tmp_path: Path) -> None:
    path = tmp_path / "b.csv"
    path.write_text("Strain (%);Stress (kPa)\n" + "".join(f"{i};{2 * i}\n" for i in range(1, 9)))
    at = np.arange(1.0, 9.0)
    columns = Columns("tension-positive", strain="Strain", stress="Stress")
    pulled, _ = read_homogeneous_test(path, columns)
    np.testing.assert_allclose(pulled.deformation, 1.0 + 0.01 * at)  # stretch
    np.testing.assert_allclose(pulled.stress, 2e3 * at)
    pushed, _ = read_homogeneous_test(path, replace(columns, convention="compression-positive"))
    np.testing.assert_allclose(pushed.deformation, 1.0 - 0.01 * at)
    np.testing.assert_allclose(pushed.stress, -2e3 * at)
    sheared, _ = read_homogeneous_test(path, columns, mode=Mode.SIMPLE_SHEAR)
    np.testing.assert_allclose(sheared.deformation, 0.01 * at)  # the amount of shear is 0 at rest


def neo_hookean(name: str, stretch: np.ndarray, factor: float = 1.0) -> HomogeneousTest:
    stress = factor * incompressible_stress(LAWS["neo_hookean"](1e4), Mode.UNIAXIAL, stretch)
    return HomogeneousTest(name, Mode.UNIAXIAL, stretch, stress)


def test_means_keep_tension_and_compression_apart() -> None:
    push, pull = np.linspace(0.6, 0.97, 9), np.linspace(1.03, 1.6, 9)
    tests = [neo_hookean("a", push, 0.9), neo_hookean("b", pull), neo_hookean("c", push, 1.1)]
    mean, alone = means_by_mode(tests, 9)
    assert (mean.name, alone.name) == ("mean of 2 uniaxial", "b")
    np.testing.assert_allclose(mean.stress, neo_hookean("m", mean.deformation).stress, rtol=1e-12)
    assert [test.name for test in with_unique_names([tests[0], tests[0], tests[1]])] == [
        "uniaxial a (1)",
        "uniaxial a (2)",
        "b",
    ]


@pytest.mark.parametrize(("durbin_watson", "said"), [(0.99, True), (1.0, False), (1.5, False)])
def test_dependent_residuals_are_said_below_one(durbin_watson: float, said: bool) -> None:
    best = SimpleNamespace(
        candidate=SimpleNamespace(name="neo_hookean"),
        fit=SimpleNamespace(bounds_cost=1.0, durbin_watson=durbin_watson),
        first_failure=None,
    )
    lines = remarks(SimpleNamespace(rows=[best], best=best, tests=[]))
    assert any("Durbin-Watson" in line for line in lines) is said
