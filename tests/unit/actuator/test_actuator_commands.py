"""The three commands on a small actuator: what they write, what they warn of."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from kolsky.cli.commandline import app

SPEC = """
pressures = ["0.2 bar", "0.4 bar"]
[geometry]
chambers = 2
element = "hex8"
[material]
constants = { mu = "218 kPa" }
D1 = "1.150 1/MPa"
density = "1.02 g/cm^3"
[gravity]
downward = [0.0, 0.0, -9.81]
[healed]
mu = "214 kPa"
[motion]
ramp = "20 ms"
hold = "20 ms"
step = "5 ms"
[invert]
angles = ["2 deg", "30 deg"]
most = "0.6 bar"
[control]
angles = ["1.5 deg", "3 deg"]
hold = "2 s"
most = "0.6 bar"
modes = 5
snapshots = 6
"""


def _run(*words: object) -> str:
    result = CliRunner().invoke(app, [str(word) for word in words])
    assert result.exit_code == 0, result.output
    return result.output


@pytest.mark.slow
def test_simulate_invert_and_control(tmp_path: Path) -> None:
    spec = tmp_path / "small.toml"
    spec.write_text(SPEC)
    _run("actuator", "simulate", spec, "--out", tmp_path / "s", "--vtu", "--film", "gif")
    for name in ("actuator.html", "bend.csv", "line.csv", "motion.csv", "downward.vtu", "downward.gif"):
        assert (tmp_path / "s" / name).stat().st_size > 0, name
    bends = json.loads((tmp_path / "s" / "actuator.json").read_text())["bends"]["downward"]
    # softer by 214 / 218 alone: it bends more, by less than twice that
    assert 0.0 < bends["healed_over_pristine_less_1"][0] < 0.04
    said = _run("actuator", "invert", spec, "--out", tmp_path / "i")
    assert "beyond the largest pressure" in said
    found = json.loads((tmp_path / "i" / "actuator.json").read_text())["found"]["downward"]
    assert [one["ended"] for one in found] == ["reached", "beyond the largest pressure"]
    _run("actuator", "control", spec, "--out", tmp_path / "c")
    run = json.loads((tmp_path / "c" / "actuator.json").read_text())["runs"]["downward"]
    assert run["ticks"] == 80
    assert max(run["settled_error_rad"]) < 1e-3
    assert (tmp_path / "c" / "downward.csv").read_text().startswith("time (s),")


def test_a_missing_table_is_named(tmp_path: Path) -> None:
    spec = tmp_path / "small.toml"
    spec.write_text(SPEC[: SPEC.index("[motion]")])
    for command, table in (("invert", "invert"), ("control", "control")):
        result = CliRunner().invoke(app, ["actuator", command, str(spec), "--out", str(tmp_path / "x")])
        assert result.exit_code == 2
        assert f"[{table}]" in result.output
