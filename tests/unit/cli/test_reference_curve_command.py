"""`kolsky material reference-curve` from files to a curve that a shot reads."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from kolsky.cli import app
from kolsky.material.reference_curve import curve_table
from kolsky.shot.curve import conditioned_ratio, with_pull
from kolsky.shot.load import load_shot

ROOT = Path(__file__).resolve().parents[3]
E = 60e3
AREA = np.pi * 4.75e-3**2
LENGTH = 6.5e-3
COMMAND = ("material", "reference-curve")
DECLARED = ["--convention", "compression-positive", "--branch", "compression"]


def write_test(path: Path, factor: float, *, cycles: int = 1) -> Path:
    """A record of a machine: time, travel, load; the second loading is 20 % softer."""
    up = np.linspace(0.0, 0.62, 300)
    strain, softer = up, np.ones(up.size)
    for _ in range(cycles - 1):
        strain = np.concatenate([strain, up[::-1][1:], up[1:]])
        softer = np.concatenate([softer, np.full(2 * up.size - 2, 0.8)])
    lam = 1.0 - strain
    load = factor * softer * E / 3.0 * (lam**-2 - lam) * AREA
    rows = [f"{0.1 * i:.3f},{1e3 * LENGTH * strain[i]:.6f},{load[i]:.7f}" for i in range(strain.size)]
    path.write_text("Time (s),Travel (mm),Load (N)\n" + "\n".join(rows) + "\n")
    return path


def run(tmp_path: Path, *more: str, cycles: int = 1) -> tuple[int, str, str]:
    files = [
        str(write_test(tmp_path / f"s{i}.csv", f, cycles=cycles)) for i, f in enumerate((0.97, 1.0, 1.03))
    ]
    columns = ["--displacement", "Travel", "--force", "Load", "--time", "Time"]
    size = ["--diameter", "9.5 mm", "--length", "6.5 mm", "--out", str(tmp_path / "out" / "curve.csv")]
    result = CliRunner().invoke(app, [*COMMAND, *files, *DECLARED, *columns, *size, *more])
    return result.exit_code, result.stdout, result.stderr


def shot_with(folder: Path, results: Path) -> Path:
    """The shot open-01 with the curve that the command wrote."""
    shutil.copytree(ROOT / "runs" / "open-01", folder, ignore=shutil.ignore_patterns("results", "*.py"))
    for file in results.glob("*.csv"):
        shutil.copy(file, folder)
    text = (folder / "shot.toml").read_text()
    before, rest = text.split("[curve]", 1)
    after = rest[rest.index("[model]") :]
    (folder / "shot.toml").write_text(before + (results / "curve.toml").read_text() + "\n" + after)
    return folder


def test_a_shot_reads_what_the_command_writes(tmp_path: Path):
    code, out, err = run(tmp_path, "--conditioned", "--json", "--scale-sigma", "0.5 %", cycles=2)
    assert code == 0, err
    said = json.loads(out)
    # The mean of the factors is 1 and E_a constant; a convex curve's mean over a spacing adds 2e-3 at most.
    assert said["curves"]["first"]["mean_E_a"]["value"] == pytest.approx(E, rel=2e-3)
    assert said["curves"]["conditioned"]["mean_E_a"]["value"] == pytest.approx(0.8 * E, rel=2e-3)
    shot = load_shot(shot_with(tmp_path / "shot", tmp_path / "out"))
    curve = shot.curve
    lam = curve.stretch
    assert curve.stress == pytest.approx(E / 3.0 * (lam - lam**-2), rel=2e-3)
    assert curve.modes is not None
    assert curve.modes.shape == (3, 60)  # two between three tests, one scale
    # 3 % between 3 specimens: 3 % / sqrt(3), widened for two degrees of freedom by 2.26; and 0.5 %.
    expected = np.hypot(0.03 / 3**0.5 * 2.263, 0.005)
    assert curve.total_sigma / -curve.stress == pytest.approx(np.full(60, expected), rel=2e-3)
    ratio = conditioned_ratio(curve)
    assert ratio == pytest.approx(0.8, rel=2e-3)
    assert with_pull(shot, "conditioned").curve is curve.conditioned
    assert {"curve.csv", "curve_conditioned.csv"} <= set(shot.inputs)


def test_modulus_is_written_over_strain_and_time(tmp_path: Path):
    assert run(tmp_path)[0] == 0
    header, *rows = (tmp_path / "out" / "curve_modulus.csv").read_text().splitlines()
    assert header.split(",")[:3] == ["nominal strain (1)", "time since zero strain (s)", "E_a (Pa)"]
    strain, time, modulus = np.array([row.split(",")[:3] for row in rows], dtype=float).T
    assert modulus == pytest.approx(np.full(60, E), rel=2e-3)
    assert time == pytest.approx(strain / 0.62 * 29.9, rel=2e-3)  # 300 samples, 0.1 s apart


def test_a_shot_without_a_conditioned_curve_says_so():
    shot = load_shot(ROOT / "runs" / "open-01")
    assert with_pull(shot, "first") is shot
    with pytest.raises(ValueError, match=r"curve\.conditioned"):
        with_pull(shot, "conditioned")


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (["--toe", "steep"], "write none, or line:LOW:HIGH"),
        (["--friction", "slippery"], "--friction"),
        (["--friction", "free"], "--friction free needs --bulge"),
        (["--friction-sigma", "0.1"], "goes with a number"),
        (["--compliance", "3 mm"], "expected a compliance"),
        (["--unit", "Stroke=mm"], "names no column that is read"),
        (["--conditioned"], "one loading ramp"),
        (["--last-strain", "0.9"], "the curve may end at a strain in"),
        (["--scale-sigma", "60 %"], "must be in [0, 0.5)"),
        (["--strain", "Travel"], "needs --strain and --stress, or --displacement and --force"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(tmp_path: Path, more: list[str], message: str):
    code, _, err = run(tmp_path, *more)
    assert code == 2
    assert message in err
    assert len(err.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_columns_without_a_unit_ask_for_it(tmp_path: Path):
    path = write_test(tmp_path / "a.csv", 1.0)
    path.write_text(path.read_text().replace("Load (N)", "Load"))
    args = [
        "material",
        "reference-curve",
        str(path),
        *DECLARED,
        "--displacement",
        "Travel",
        "--force",
        "Load",
    ]
    size = ["--diameter", "9.5 mm", "--length", "6.5 mm", "--out", str(tmp_path / "c.csv")]
    result = CliRunner().invoke(app, [*args, *size])
    assert result.exit_code == 2
    assert "--unit 'Load=N'" in result.stderr
    assert CliRunner().invoke(app, [*args, *size, "--unit", "Load=N"]).exit_code == 0


def test_table_for_a_tension_curve_says_tension(tmp_path: Path):
    from kolsky.material.reference_curve import Treatment, reference_curve
    from kolsky.material.uniaxial import UniaxialTest

    strain = np.linspace(0.01, 1.0, 50)
    test = UniaxialTest("t", strain, E / 3.0 * (1.0 + strain - (1.0 + strain) ** -2), compression=False)
    text = curve_table("c.csv", reference_curve([test], Treatment()), None)
    assert 'branch = "tension"' in text
    assert "modes" not in text  # one test without a toe has none
