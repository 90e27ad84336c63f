"""The three commands on a small actuator: what they write, what they warn of."""

import json
from pathlib import Path

import numpy as np
import pytest
import pyvista
from typer.testing import CliRunner

from kolsky.cli.commandline import app
from kolsky.equilibrium.meshes import box

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
    _run("actuator", "simulate", spec, "--out", tmp_path / "s", "--vtu", "--film", "gif", "--json")
    for name in ("actuator.html", "bend.csv", "line.csv", "motion.csv", "downward.vtu", "downward.gif"):
        assert (tmp_path / "s" / name).stat().st_size > 0, name
    bends = json.loads((tmp_path / "s" / "actuator.json").read_text())["bends"]["downward"]
    # softer by 214 / 218 alone: it bends more, by less than twice that
    assert 0.0 < bends["healed_over_pristine_less_1"][0] < 0.04
    said = _run("actuator", "invert", spec, "--out", tmp_path / "i", "--json")
    assert "beyond the largest pressure" in said
    found = json.loads((tmp_path / "i" / "actuator.json").read_text())["found"]["downward"]
    assert [one["ended"] for one in found] == ["reached", "beyond the largest pressure"]
    _run("actuator", "control", spec, "--out", tmp_path / "c", "--json")
    run = json.loads((tmp_path / "c" / "actuator.json").read_text())["runs"]["downward"]
    assert run["ticks"] == 80
    assert max(run["settled_error_rad"]) < 1e-3
    assert (tmp_path / "c" / "downward.csv").read_text().startswith("time (s),")


@pytest.mark.slow
def test_chambers_touch_by_command(tmp_path: Path) -> None:
    text = SPEC[: SPEC.index("[healed]")].replace('"0.2 bar", "0.4 bar"', '"0.1 bar", "0.3 bar"')
    thin = 'element = "hex8"\nwall = "1.2 mm"\ngap = "0.3 mm"\ncell = "3 mm"\ninlet = "2 mm"'
    spec = tmp_path / "touching.toml"
    spec.write_text(text.replace('element = "hex8"', thin))
    assert "declare [contact]" in _run("actuator", "simulate", spec, "--out", tmp_path / "free")
    spec.write_text(spec.read_text() + "[contact]\n")
    said = _run("actuator", "simulate", spec, "--out", tmp_path / "t")
    assert "overlap" not in said
    found = json.loads((tmp_path / "t" / "actuator.json").read_text())["bends"]["downward"]
    free = json.loads((tmp_path / "free" / "actuator.json").read_text())["bends"]["downward"]
    assert free["contact_force_N"] is None
    assert found["contact_force_N"][1] > 0.01
    assert found["angle_rad"][1] > 1.02 * free["angle_rad"][1]
    assert "Contact of neighbouring chambers" in (tmp_path / "t" / "actuator.html").read_text()
    assert "contact force (N)" in (tmp_path / "t" / "bend.csv").read_text()


def _arch(path: Path) -> None:
    """A shallow clamped arch, whose upper side is the cavity."""
    span, rise = 100.0, 4.0
    mesh = box((span, 5.0, 2.0), (8, 1, 1), kind="hex27")
    top = mesh.nodes("front")
    lift = rise * np.sin(np.pi * mesh.points[:, 0] / span) ** 2
    points = mesh.points + np.column_stack([0.0 * lift, 0.0 * lift, lift])
    cells = np.column_stack([np.full(len(mesh.cells), 27), mesh.cells]).ravel()
    grid = pyvista.UnstructuredGrid(cells, np.full(len(mesh.cells), mesh.element.vtk), points)
    x, z = mesh.points[:, 0], mesh.points[:, 2]
    low = z < 1e-9
    masks = {
        "clamp": (x < 1e-9) | (x > span - 1e-9),
        "origin": (x < 1e-9) & low,
        "tip": (np.abs(x - 0.5 * span) < 1e-9) & low,
        "cavity": np.isin(np.arange(len(x)), top),
        "mirror": (mesh.points[:, 1] < 1e-9) | (mesh.points[:, 1] > 5.0 - 1e-9),
    }
    for name, mask in masks.items():
        grid.point_data[f"set:{name}"] = mask.astype(np.uint8)
    grid.save(path)


@pytest.mark.slow
def test_an_arch_snaps_by_command(tmp_path: Path) -> None:
    _arch(tmp_path / "arch.vtu")
    spec = tmp_path / "arch.toml"
    text = SPEC[: SPEC.index("[healed]")].replace('"0.2 bar", "0.4 bar"', '"0.1 mbar", "2 mbar"')
    geometry = 'mesh = "arch.vtu"\nmesh_unit = "mm"\n[material]'
    text = text.replace("downward = [0.0, 0.0, -9.81]", "weightless = [0.0, 0.0, 0.0]")
    head, tail = text.split("[geometry]")[0], text.split("[material]")[1]
    spec.write_text(head + "[geometry]\n" + geometry + tail + '[path]\nfirst = "0.05 mbar"\n')
    said = _run("actuator", "simulate", spec, "--out", tmp_path / "a", "--figures", "png")
    assert "snaps there" in said
    found = json.loads((tmp_path / "a" / "actuator.json").read_text())["bends"]["weightless"]
    first, second = found["limit_pressures_Pa"]
    # of the order of EI (2 pi / L)^4 rise = 30 Pa
    assert second < first < 200.0
    assert first > 10.0
    # upright below the limit, hanging beyond it
    assert found["angle_rad"][0] < 0.0 < found["angle_rad"][1]
    path = np.genfromtxt(tmp_path / "a" / "path_weightless.csv", delimiter=",", names=True)
    assert path["pressure_Pa"].max() >= 200.0


def test_a_missing_table_is_named(tmp_path: Path) -> None:
    spec = tmp_path / "small.toml"
    spec.write_text(SPEC[: SPEC.index("[motion]")])
    for command, table in (("invert", "invert"), ("control", "control")):
        result = CliRunner().invoke(app, ["actuator", command, str(spec), "--out", str(tmp_path / "x")])
        assert result.exit_code == 2
        assert f"[{table}]" in result.output
