"""Headers that the package writes itself: `kolsky channels` shows their units, `material fit` reads them."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from kolsky.cli import app

HEAD = "nominal strain (1),nominal stress (Pa),independent sigma (Pa)"


@pytest.fixture
def curve(tmp_path):
    """A table as `kolsky material reference-curve` writes it: 20 kPa (lam^-2 - lam)."""
    lam = 1.0 - np.linspace(0.02, 0.5, 12)
    rows = np.column_stack([1.0 - lam, 20e3 * (lam**-2 - lam), np.full(12, 10.0)])
    np.savetxt(tmp_path / "curve.csv", rows, delimiter=",", header=HEAD, comments="")
    return tmp_path / "curve.csv"


def test_units_in_brackets_are_shown(curve):
    shown = json.loads(CliRunner().invoke(app, ["channels", str(curve), "--json"]).stdout)
    assert [channel["unit"] for channel in shown["channels"]] == ["1", "Pa", "Pa"]


@pytest.mark.parametrize("bracket", ["", " ({})"])
def test_a_written_curve_is_fitted(curve, bracket):
    columns = [f"nominal strain{bracket.format('1')}", f"nominal stress{bracket.format('Pa')}"]
    done = CliRunner().invoke(
        app,
        ["material", "fit", str(curve), "--strain", columns[0], "--stress", columns[1], "--convention",
         "compression-positive", "--laws", "neo_hookean", "--out", str(curve.parent / "out"), "--json"],
    )  # fmt: skip
    assert done.exit_code == 0, done.output
    fit = json.loads(done.stdout)["laws"][0]["fit"]
    assert fit["constants"]["mu"] == pytest.approx(20e3, rel=1e-9)
