"""`kolsky identify SHOT...`: options change the settings; impossible ones are rejected before any work."""

from pathlib import Path

import pytest
from kolsky_command import run_kolsky

from kolsky.base.errors import InputError
from kolsky.cli.identify import identify_shots, require_one_material
from kolsky.inverse.settings import JointSettings, Numerics, Settings

OPEN_01 = Path(__file__).parents[3] / "runs" / "open-01"
ONE = Settings(
    hold=("damping",), numerics=Numerics(mesh=(12, 16)), refined_mesh=(24, 32), replicates=3, seed=2
)


class Reached(Exception):
    """The settings with which the library is called."""


def test_the_options_reach_the_settings(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def stop(shots: object, settings: JointSettings, **others: object) -> None:
        raise Reached(settings)

    monkeypatch.setattr("kolsky.joint_identification.identify_shots", stop)
    joint = JointSettings(curve_nodes=6, curve_roughness=0.2, gain_each=0.005, scatter=False)
    with pytest.raises(Reached) as caught:
        identify_shots([OPEN_01], joint, ONE, slow_tests=None, relaxation=None, out=tmp_path, figures=())
    (made,) = caught.value.args
    shared = (("damping",), Numerics(mesh=(12, 16)), (24, 32), 3, 2)
    assert (made.hold, made.numerics, made.refined_mesh, made.replicates, made.seed) == shared
    assert (made.curve_nodes, made.curve_roughness, made.gain_each, made.scatter) == (6, 0.2, 0.005, False)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("a", "b", "--diagnose"), "--diagnose is for a single shot"),
        (("a", "b", "--gain-each", "much"), "--gain-each"),
        (("a", "b", "--curve-nodes", "3"), "curve_nodes must be 0 or 4 to 24, got 3"),
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
