"""`kolsky material healing`: planted constants and fractures, efficiencies by hand, what is refused."""

import csv
import json

import numpy as np
import pytest
from typer.testing import CliRunner

from kolsky.cli import app


def tensile(path, mu, end):
    """A neo-Hookean strip, mu (lam - lam^-2) in kPa over per cent, that breaks at the strain `end`."""
    strain = np.append(np.linspace(0.0, end, 131), end + 0.01)
    lam = 1.0 + strain
    stress = np.append((mu * (lam - lam**-2))[:-1], 0.0)
    rows = np.column_stack([100.0 * strain, 1e-3 * stress])
    np.savetxt(path, rows, delimiter=",", header="Strain (%),Stress (kPa)", comments="")
    return str(path)


def run(*words):
    return CliRunner().invoke(
        app, ["material", "healing", *words, "--strain", "Strain", "--stress", "Stress"]
    )


def test_planted_groups(tmp_path):
    before = [
        tensile(tmp_path / f"u{k}.csv", mu, end) for k, (mu, end) in enumerate([(2.0e5, 1.3), (2.2e5, 1.2)])
    ]
    after = [
        tensile(tmp_path / f"h{k}.csv", mu, end)
        for k, (mu, end) in enumerate([(1.9e5, 1.0), (2.1e5, 1.2), (2.0e5, 1.1)])
    ]
    words = [word for file in before for word in ("--undamaged", file)]
    words += [word for file in after for word in ("--healed", file)]
    done = run(*words, "--out", str(tmp_path / "out"), "--json")
    assert done.exit_code == 0, done.output
    said = json.loads(done.stdout)
    mu, strain = said["properties"]["mu"], said["properties"]["fracture strain"]
    assert mu["undamaged"]["value"] == pytest.approx(2.1e5, rel=1e-6)
    assert mu["healed"]["value"] == pytest.approx(2.0e5, rel=1e-6)
    # u of both means: 0.1e5 / sqrt(2) * sqrt(2) and 0.1e5 / sqrt(3); of the quotient by both.
    assert mu["undamaged"]["sigma"] == pytest.approx(1e4)
    assert mu["healed"]["sigma"] == pytest.approx(1e4 / np.sqrt(3.0), rel=1e-5)
    ratio = 2.0 / 2.1
    u = ratio * np.hypot(0.1 / 2.1, 0.1 / np.sqrt(3.0) / 2.0)
    assert mu["efficiency"]["value"] == pytest.approx(ratio, rel=1e-6)
    assert mu["efficiency"]["sigma"] == pytest.approx(u, rel=1e-4)
    assert strain["efficiency"]["value"] == pytest.approx(1.1 / 1.25)
    # Gaussian rubber's tangent falls by 1/(1 + e)^3: to 5 % its regression is below 3 mu.
    modulus = said["properties"]["Young's modulus to 5 %"]
    assert 0.93 * 6.3e5 < modulus["undamaged"]["value"] < 6.3e5
    with (tmp_path / "out" / "healing.csv").open(encoding="utf-8") as file:
        assert [row["property"] for row in csv.DictReader(file)] == list(said["properties"])


def test_one_specimen_has_no_scatter_and_no_break_no_fracture(tmp_path):
    one, other = tensile(tmp_path / "u.csv", 2e5, 1.3), tmp_path / "h.csv"
    lines = tensile(other, 1.8e5, 1.2) and other.read_text().splitlines()
    other.write_text("\n".join(lines[:-2]) + "\n")  # the record ends before the break
    done = run("--undamaged", one, "--healed", str(other), "--out", str(tmp_path / "out"), "--json")
    assert done.exit_code == 0, done.output
    said = json.loads(done.stdout)
    assert "fracture stress" not in said["properties"]
    assert said["properties"]["mu"]["efficiency"] == {"value": pytest.approx(0.9, rel=1e-6), "sigma": None}
    assert sum("is unknown" in remark for remark in said["remarks"]) == 2


def test_a_file_is_of_one_group(tmp_path):
    one = tensile(tmp_path / "u.csv", 2e5, 1.3)
    done = run("--undamaged", one, "--healed", one)
    assert done.exit_code == 2
    assert "is named as undamaged and as healed" in done.output
