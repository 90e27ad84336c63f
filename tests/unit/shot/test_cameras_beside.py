"""Another process calibrates the cameras if there are free cores."""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import pytest

from dic.processes import allow_forks, can_fork
from kolsky.pictures import rig

pytestmark = pytest.mark.skipif(not can_fork(), reason="one core, or no copies of processes here")


@contextmanager
def begun(toml: Any, section: Any, *, predict: bool) -> Iterator[Callable[..., Any]]:
    def solved(progress: Any) -> Any:
        progress("calibration", 1, 1)
        return SimpleNamespace(rig=os.getpid(), pairs=(), rms=0.1, rejected=(), unusable=())

    yield solved


@pytest.mark.parametrize(("cores", "forks", "here"), [(3, True, True), (4, True, False), (4, False, True)])
def test_who_works_out_the_cameras(
    monkeypatch: pytest.MonkeyPatch, cores: int, forks: bool, here: bool
) -> None:
    monkeypatch.setattr(rig, "calibration_in_background", begun)
    monkeypatch.setattr(rig, "cropped", lambda toml, found, series: found)
    monkeypatch.setattr(rig, "cores", lambda: cores)
    if not forks:
        monkeypatch.setattr(rig, "may_fork", lambda: False)
    section = SimpleNamespace(file=None)
    toml = SimpleNamespace(declared=SimpleNamespace(calibration=section))
    pictures: Any = SimpleNamespace(toml=toml, series=())
    told: list[tuple[str, int, int]] = []
    with allow_forks(), rig.calibrate_in_background(pictures) as cameras:
        found = cameras(lambda *said: told.append(said))
    assert (found.rig == os.getpid()) is here
    assert told == ([("calibration", 1, 1)] if here else [])
    assert found.words == "0 of 0 pairs of pictures, residual 0.1 px rms"
