"""A command parses the shot file once and fits the path of the flyer once. The results are passed on."""

import tomllib

import pytest
from damaged_shots import toml
from kolsky_command import run_kolsky

from kolsky.bars.flyer import events
from kolsky.shot import records

COARSE = ("--free", "stiffness_factor", "--mesh", "6x8", "--refined-mesh", "8x11", "--replicates", "0")


@pytest.fixture
def counts(monkeypatch) -> dict[str, int]:
    """Calls of the TOML parser, and of the fit of a flyer's path wherever a command could make one."""
    made = {"parsed": 0, "fitted": 0}

    def counted(key, function):
        def call(*args, **options):
            made[key] += 1
            return function(*args, **options)

        return call

    monkeypatch.setattr(tomllib, "loads", counted("parsed", tomllib.loads))
    for module in (records, events):
        monkeypatch.setattr(module, "fit_flyer", counted("fitted", module.fit_flyer))
    return made


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

    said = 'file = "quasi_static.csv"'
    toml(said, f'{said}\nconditioned = "quasi_static.csv"')(shot)
    loaded = load_shot(shot)
    other = with_pull(loaded, "conditioned")
    assert other.flyer_path is loaded.flyer_path
    assert counts == {"parsed": 1, "fitted": 1}
