"""Pictures of deformed specimens: the field in closed form, and what is refused."""

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from kolsky.cli.commandline import app
from kolsky.equilibrium.meshes import box
from kolsky.equilibrium.model import Fixed, Model, Prescribed
from kolsky.equilibrium.solid import CompressibleNeoHookean
from kolsky.equilibrium.solve import solve
from kolsky.report.films import largest_stretches
from kolsky.report.scene import drawing

RUBBER = CompressibleNeoHookean.from_young(30e3, 0.3)


@pytest.mark.parametrize("kinematics", ["3d", "plane_strain"])
def test_stretches_of_a_uniform_pull(kinematics: str) -> None:
    d = 3 if kinematics == "3d" else 2
    kind = "hex8" if d == 3 else "quad4"
    free = tuple(Fixed(side, (axis,)) for side, axis in (("left", 0), ("bottom", 1), ("back", 2))[:d])
    mesh = box((2.0, 1.0, 0.5)[:d], (2, 1, 1)[:d], kind=kind)
    model = Model(mesh, RUBBER, (*free, Prescribed("right", 0, "pull")), kinematics=kinematics)  # type: ignore[arg-type]
    stretches = largest_stretches(solve(model, {"pull": [0.5, 1.0]}))
    np.testing.assert_allclose(stretches, [1.5, 1.5], rtol=1e-9)


def test_stills_are_refused_before_the_fit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def absent() -> None:
        raise drawing.CannotRender("pictures of the scene need PyVista")

    monkeypatch.setattr(drawing, "offscreen_pyvista", absent)
    result = CliRunner().invoke(app, ["specimen", "fit", str(tmp_path / "none.toml"), "--stills"])
    assert result.exit_code == 2
    assert "need PyVista" in result.output
    assert "--vtu" in result.output
