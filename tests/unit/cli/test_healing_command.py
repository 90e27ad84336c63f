"""`kolsky material healing`: known constants and fractures, efficiencies by hand, rejected inputs."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from kolsky_command import json_of, rows_of, run_kolsky
from typer.testing import CliRunner

from kolsky.cli import app
from kolsky.material.reference_curve import curve_table
from kolsky.shot.curve import conditioned_ratio, with_pull
from kolsky.shot.load import load_shot


def tensile(path, mu, end):
    """A neo-Hookean strip, mu (lam - lam^-2) in kPa over per cent, that breaks at the strain `end`."""
    strain = np.append(np.linspace(0.0, end, 131), end + 0.01)
    lam = 1.0 + strain
    stress = np.append((mu * (lam - lam**-2))[:-1], 0.0)
    rows = np.column_stack([100.0 * strain, 1e-3 * stress])
    np.savetxt(path, rows, delimiter=",", header="Strain (%),Stress (kPa)", comments="")
    return str(path)


HEALING = ("material", "healing", "--strain", "Strain", "--stress", "Stress")


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
    said = json_of(*HEALING, *words, "--out", tmp_path / "out")
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
    assert [row["property"] for row in rows_of(tmp_path / "out" / "healing.csv")] == list(said["properties"])


def test_one_specimen_has_no_scatter_and_no_break_no_fracture(tmp_path):
    one, other = tensile(tmp_path / "u.csv", 2e5, 1.3), tmp_path / "h.csv"
    lines = tensile(other, 1.8e5, 1.2) and other.read_text().splitlines()
    other.write_text("\n".join(lines[:-2]) + "\n")  # the record ends before the break
    said = json_of(*HEALING, "--undamaged", one, "--healed", other, "--out", tmp_path / "out")
    assert "fracture stress" not in said["properties"]
    assert said["properties"]["mu"]["efficiency"] == {"value": pytest.approx(0.9, rel=1e-6), "sigma": None}
    assert sum("is unknown" in remark for remark in said["remarks"]) == 2


def test_a_file_is_of_one_group(tmp_path):
    one = tensile(tmp_path / "u.csv", 2e5, 1.3)
    done = run_kolsky(*HEALING, "--undamaged", one, "--healed", one, code=2)
    assert "is named as undamaged and as healed" in done.output


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


def fit_curve(tmp_path: Path, *more: str, cycles: int = 1) -> tuple[int, str, str]:
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
    code, out, err = fit_curve(tmp_path, "--conditioned", "--json", "--scale-sigma", "0.5 %", cycles=2)
    assert code == 0, err
    said = json.loads(out)
    # The mean of the factors is 1 and E_a constant; a convex curve's mean over a spacing adds 2e-3 at most.
    assert said["curves"]["first"]["mean_E_a"]["value"] == pytest.approx(E, rel=2e-3)
    assert said["curves"]["conditioned"]["mean_E_a"]["value"] == pytest.approx(0.8 * E, rel=2e-3)
    assert said["softening"]["value"] == pytest.approx(0.8, rel=1e-6)
    shot = load_shot(shot_with(tmp_path / "shot", tmp_path / "out"))
    curve = shot.curve
    lam = curve.stretch
    assert curve.stress == pytest.approx(E / 3.0 * (lam - lam**-2), rel=2e-3)
    assert curve.modes.shape == (3, 60)  # two between three tests, one scale
    # 3 % between 3 specimens: 3 % / sqrt(3), widened for two degrees of freedom by 2.26; and 0.5 %.
    expected = np.hypot(0.03 / 3**0.5 * 2.263, 0.005)
    assert curve.total_sigma / -curve.stress == pytest.approx(np.full(60, expected), rel=2e-3)
    ratio = conditioned_ratio(curve)
    assert ratio == pytest.approx(0.8, rel=2e-3)
    assert with_pull(shot, "conditioned").curve is curve.conditioned
    assert {"curve.csv", "curve_conditioned.csv"} <= set(shot.inputs)


def test_modulus_is_written_over_strain_and_time(tmp_path: Path):
    assert fit_curve(tmp_path)[0] == 0
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
    code, _, err = fit_curve(tmp_path, *more)
    assert code == 2
    assert message in err
    assert len(err.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_columns_without_a_unit_ask_for_it(tmp_path: Path):
    path = write_test(tmp_path / "a.csv", 1.0)
    path.write_text(path.read_text().replace("Load (N)", "Load"))
    args = [
        "material", "reference-curve", str(path), *DECLARED, "--displacement", "Travel", "--force", "Load",
    ]  # fmt: skip
    size = ["--diameter", "9.5 mm", "--length", "6.5 mm", "--out", str(tmp_path / "c.csv")]
    result = run_kolsky(*args, *size, code=2)
    assert "--unit 'Load=N'" in result.stderr
    assert CliRunner().invoke(app, [*args, *size, "--unit", "Load=N"]).exit_code == 0


def test_table_for_a_tension_curve_says_tension(tmp_path: Path):
    from kolsky.material.reference_curve import Treatment, reference_curve
    from kolsky.material.uniaxial import UniaxialTest

    strain = np.linspace(0.01, 1.0, 50)
    test = UniaxialTest("t", strain, E / 3.0 * (1.0 + strain - (1.0 + strain) ** -2), compression=False)
    text = curve_table("c.csv", reference_curve([test], Treatment()).band, compression=False)
    assert 'branch = "tension"' in text
    assert "modes" not in text  # one test without a toe has none
