"""`kolsky identify SHOT...`: options change the settings; impossible ones are rejected before any work."""

from pathlib import Path

import pytest
from kolsky_command import run_kolsky

from kolsky.base.errors import InputError
from kolsky.cli.identify import JointOptions, require_one_material
from kolsky.inverse.settings import Numerics, Settings

ONE = Settings(
    hold=("damping",), numerics=Numerics(mesh=(12, 16)), refined_mesh=(24, 32), replicates=3, seed=2
)


def test_the_options_reach_the_settings() -> None:
    made = JointOptions(curve_nodes=6, curve_roughness=0.2, gain_each=0.005, scatter=False).settings(ONE)
    assert (made.curve_nodes, made.curve_roughness, made.scatter) == (6, 0.2, False)
    assert made.gain_each == 0.005
    assert (made.hold, made.refined_mesh, made.replicates, made.seed) == (("damping",), (24, 32), 3, 2)
    assert not JointOptions().is_needed
    assert JointOptions(curve_nodes=4).is_needed


def test_values_that_cannot_be_name_the_command_line() -> None:
    with pytest.raises(InputError, match="curve_nodes must be 0 or 4 to 24, got 3"):
        JointOptions(curve_nodes=3).settings(ONE)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("a", "b", "--diagnose"), "--diagnose is for a single shot"),
        (("a", "b", "--gain-each", "much"), "--gain-each"),
        (("a", "b", "--each", "--no-scatter"), "--no-scatter is for several shots together"),
        (("a", "--each", "--slow-tests", "x", "--curve-nodes", "4"), "--slow-tests, --curve-nodes is for"),
        (("a", "--free", "poisson", "--hold", "poisson"), "named by both --free and --hold"),
        (("a", "--element", "other"), "it must be one_point or fbar"),
        (("a", "--device", "cuda:77"), "kolsky doctor"),
    ],
)
def test_options_outside_their_mode_are_refused(words: tuple[str, ...], message: str) -> None:
    done = run_kolsky("identify", *words, code=2)
    assert message in done.stderr


def test_shots_of_two_materials_are_refused(tmp_path: Path) -> None:
    folders = []
    for name, line in (("a", 'material = "gel A"'), ("b", ""), ("c", 'material = "gel B"')):
        (tmp_path / name).mkdir()
        (tmp_path / name / "shot.toml").write_text(f"format = 1\n{line}\n", "utf-8")
        folders.append(tmp_path / name)
    require_one_material(folders[:2])  # one says nothing
    with pytest.raises(InputError) as caught:
        require_one_material(folders)
    message = str(caught.value)
    assert message.startswith(str(tmp_path / "c" / "shot.toml"))
    assert "material is 'gel B', but " in message
    assert "has 'gel A': a joint answer is of one material" in message
