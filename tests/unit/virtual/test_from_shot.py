"""A specification from a shot."""

from pathlib import Path

import numpy as np
import pytest

from kolsky.base.records import MaterialCurve
from kolsky.schema.apparatus import UncertaintySection
from kolsky.shot.load import load_shot
from kolsky.virtual.shot_file import _uncertainty, declared_sizes, specification_of, yeoh_of
from kolsky.virtual.specification import read_specification


def test_yeoh_through_a_curve_of_its_own() -> None:
    """P = 2 (lam - lam^-2)(C10 + 2 C20 x + 3 C30 x^2) with x = I1 - 3 gives its constants back."""
    lam = np.linspace(1.0, 0.4, 40)
    x = lam**2 + 2.0 / lam - 3.0
    stress = 2.0 * (lam - lam**-2) * 12e3 * (1.0 + 2.0 * 0.1 * x + 3.0 * 0.02 * x**2)
    constants, modulus = yeoh_of(MaterialCurve(lam, stress, 0.01 * np.abs(stress)))
    assert modulus == pytest.approx(24e3, rel=1e-9)
    assert constants == pytest.approx({"C10": 1.0, "C20": 0.1, "C30": 0.02}, rel=1e-7)


def test_declared_uncertainties_become_sizes() -> None:
    given = {"specimen_length": 0.003, "damping": 5e-6, "poisson": 2e-4, "sensitivity": 0.0, "friction": 0.1}
    assert declared_sizes(given) == {
        "imperfections.length": "0.003",
        "imperfections.damping": "5e-06 s",
        "imperfections.poisson": 2e-4,
    }


def test_specification_of_open_01(tmp_path: Path) -> None:
    shot = load_shot(Path(__file__).parents[3] / "runs" / "open-01")
    made = specification_of(shot, tmp_path, answer={"stiffness_factor": 1.12})
    q = read_specification(made).shot(0).quantities
    assert q.specimen.length == pytest.approx(6.5e-3)
    assert q.material.stiffness_factor == 1.12
    # truth.json of the shot: 74 kPa / 3 and 1 : 0.1 : 0.02, here through a curve with 0.2 % of noise.
    assert q.material.shear_modulus == pytest.approx(74e3 / 3.0, rel=0.01)
    assert q.transmitted.noise == pytest.approx(1.64e-3, rel=0.05)
    assert q.frames.static == 12
    assert q.motion.kind == "sampled"


def test_lengths_have_metres_and_shares_none() -> None:
    given = {"length_in_pictures": 2e-6, "y_offset": 1e-6, "specimen_length": 1e-3, "poisson": 3e-4}
    written = _uncertainty(given)
    assert written == {
        "length_in_pictures": "2e-06 m",
        "y_offset": "1e-06 m",
        "specimen_length": "0.001",
        "poisson": 3e-4,
    }
    read = UncertaintySection.model_validate(written)
    assert read.length_in_pictures == 2e-6
    assert "length_in_pictures" not in read.for_identify()
    assert "length_in_pictures" not in read.for_waves()
