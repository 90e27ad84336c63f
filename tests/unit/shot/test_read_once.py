"""A command parses the shot file once and fits the path of the flyer once. The results are passed on."""

import shutil
import tomllib
from pathlib import Path

import pytest
from kolsky_command import run_kolsky

from kolsky.bars.flyer import events
from kolsky.shot import records

OPEN_01 = Path(__file__).resolve().parents[3] / "runs" / "open-01"
COARSE = ("--free", "stiffness_factor", "--mesh", "6x8", "--refined-mesh", "8x11", "--replicates", "0")


@pytest.fixture
def counts(monkeypatch) -> dict[str, int]:
    """Calls of the TOML parser, and of the fit of a flyer's path wherever a command could make one."""
    made = {"parsed": 0, "fitted": 0}
    monkeypatch.setattr("kolsky.report.scene.drawing.renders", lambda: False)  # the page without its 3-D view

    def counted(key, function):
        def call(*args, **options):
            made[key] += 1
            return function(*args, **options)

        return call

    monkeypatch.setattr(tomllib, "loads", counted("parsed", tomllib.loads))
    for module in (records, events):
        monkeypatch.setattr(module, "fit_flyer", counted("fitted", module.fit_flyer))
    return made


@pytest.fixture
def shot(tmp_path) -> Path:
    folder = tmp_path / "shot"
    shutil.copytree(OPEN_01, folder, ignore=shutil.ignore_patterns("results"))
    return folder


@pytest.mark.parametrize(
    "command",
    [pytest.param(("identify", *COARSE), marks=pytest.mark.slow), ("waves",)],
    ids=lambda words: words[0],
)
def test_parsed_once_and_fitted_once(command, counts, shot):
    name, *options = command
    run_kolsky(name, shot, *options)
    assert counts == {"parsed": 1, "fitted": 1}


def test_a_conditioned_curve_leaves_the_path_as_it_was_fitted(counts, shot):
    """`--pull conditioned` makes a shot with another curve; its motion is the same."""
    from kolsky.shot.curve import with_pull
    from kolsky.shot.load import load_shot

    text = (shot / "shot.toml").read_text("utf-8")
    said = 'file = "quasi_static.csv"'
    assert text.count(said) == 1
    (shot / "shot.toml").write_text(text.replace(said, f'{said}\nconditioned = "quasi_static.csv"'), "utf-8")
    loaded = load_shot(shot)
    other = with_pull(loaded, "conditioned")
    assert other.flyer_path is loaded.flyer_path
    assert counts == {"parsed": 1, "fitted": 1}
