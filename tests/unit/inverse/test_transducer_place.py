"""A transducer behind the face: closed forms of a pulse in a bar, and the whole chain from the shot file."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from shot_folders import shot_in

import kolsky
from kolsky.base.apparatus import Bar
from kolsky.base.errors import InputError
from kolsky.inverse.forward import at_transducer
from kolsky.inverse.observations import predict
from kolsky.inverse.problem import prepare_shot
from kolsky.inverse.settings import Numerics
from kolsky.inverse.simulate import simulate

BAR = Bar(15e-3, 0.5, 190e9, 8048.0)
DEPTH = 0.1
STEEL = """
transducer_depth = "100 mm"
[transmission.bar]
diameter = "15 mm"
length = "500 mm"
youngs_modulus = "190 GPa"
density = "8048 kg/m^3"
"""


def made(depth: float, bar: Bar | None = BAR) -> Any:
    return SimpleNamespace(transducer_depth=depth, transmission_bar=bar)


def test_a_pulse_passes_and_comes_back_as_tension(monkeypatch: pytest.MonkeyPatch) -> None:
    """A pulse shorter than the way to the far end: later by d, and by T - d as tension; T + d compression."""
    from kolsky.inverse import forward

    times = np.linspace(0.0, 4e-4, 40_001)
    pulse = np.exp(-(((times - 3e-5) / 5e-6) ** 2))
    impulse = np.concatenate([[0.0], np.cumsum(0.5 * (pulse[1:] + pulse[:-1]) * np.diff(times))])
    monkeypatch.setattr(forward, "replace", lambda response, **new: SimpleNamespace(**new))
    response = SimpleNamespace(
        force_times=times, force_transmission=pulse[None], impulse_transmission=impulse[None]
    )
    found = at_transducer(made(DEPTH), response)  # type: ignore[arg-type]
    d, T = DEPTH / BAR.wave_speed, BAR.round_trip

    def at(late: float) -> float:
        return float(np.interp(3e-5 + late, times, found.force_transmission[0]))

    assert at(d) == pytest.approx(1.0, abs=1e-3)
    assert at(T - d) == pytest.approx(-1.0, abs=1e-3)
    assert at(T + d) == pytest.approx(1.0, abs=1e-3)
    assert at(0.0) == pytest.approx(0.0, abs=1e-3)
    # The impulse is the integral of the force there, and returns to nothing after the tension.
    gained = np.interp([3e-5 + 0.5 * T, 3e-5 + T], times, found.impulse_transmission[0])
    np.testing.assert_allclose(gained, [5e-6 * np.sqrt(np.pi), 0.0], atol=2e-8)


def test_at_the_face_or_on_a_rigid_support_nothing_changes() -> None:
    response = object()
    assert at_transducer(made(0.0), response) is response  # type: ignore[arg-type]
    assert at_transducer(made(DEPTH, None), response) is response  # type: ignore[arg-type]


def declared(folder: Path, text: str) -> Path:
    shot = shot_in(folder)
    path = shot / "shot.toml"
    path.write_text(path.read_text("utf-8").replace('support = "rigid"', f'support = "bar"{text}'))
    return shot


def test_from_the_shot_file_to_the_prediction(tmp_path: Path) -> None:
    behind = kolsky.load_shot(declared(tmp_path / "behind", STEEL))
    assert behind.transducer_depth == pytest.approx(0.1)
    face = replace(behind, transducer_depth=0.0)
    numerics = Numerics(mesh=(6, 8))
    runs = [simulate(shot, {}, numerics=numerics) for shot in (face, behind)]
    direct, shown = (run.response for run in runs)
    assert shown.surface_r == pytest.approx(direct.surface_r)  # only the force is seen elsewhere
    delay = 0.1 / behind.transmission_bar.wave_speed  # type: ignore[union-attr]
    early = direct.force_times < direct.force_times[0] + behind.transmission_bar.round_trip - delay  # type: ignore[union-attr]
    exact = np.interp(direct.force_times - delay, direct.force_times, direct.force_transmission[0], left=0.0)
    np.testing.assert_allclose(shown.force_transmission[0][early], exact[early], atol=1e-9)
    seen = predict(shown, prepare_shot(behind).observations)
    assert not np.allclose(seen.force, predict(direct, prepare_shot(face).observations).force)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (STEEL.replace("100 mm", "260 mm"), "below half the bar"),
        (STEEL.replace('"100 mm"', '"-1 mm"'), "> 0"),
    ],
)
def test_depths_that_cannot_be(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        kolsky.load_shot(declared(tmp_path / "shot", text))


def test_a_rigid_support_has_no_depth(tmp_path: Path) -> None:
    shot = shot_in(tmp_path / "shot")
    path = shot / "shot.toml"
    rigid = 'support = "rigid"\ntransducer_depth = "10 mm"'
    path.write_text(path.read_text("utf-8").replace('support = "rigid"', rigid))
    with pytest.raises(InputError, match="nothing moves"):
        kolsky.load_shot(shot)
