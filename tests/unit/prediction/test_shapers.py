"""Laws of pulse shapers compared with closed forms, and laws recovered from their pulses."""

from pathlib import Path

import numpy as np
import pytest

from explicit.bars import Apparatus, Joint, PulseShaper, Section, integrate_test
from kolsky.base.errors import InputError
from kolsky.prediction.predict import closing, disc, from_pulse, loading, shaper_of
from kolsky.prediction.schema import ShaperTable

STEEL = {"youngs_modulus": 190e9, "density": 8048.0}
STRIKER, BAR = Section(0.25, 7.5e-3, **STEEL), Section(1.5, 7.5e-3, **STEEL)
SPEED = 5.5


def pulse_of(shaper: PulseShaper, step: float = 1e-7) -> tuple[np.ndarray, np.ndarray]:
    """The force that a shaper lets through before anything comes back from the bar's far end."""
    test = Apparatus((STRIKER,), SPEED, shaper, (BAR,), Joint(0.0), (Section(0.02, 7.5e-3, **STEEL),), (BAR,))
    history = integrate_test(test, end=0.95 * 2.0 * BAR.travel_time, step=step)
    return history.times, history.shaper_force


def test_a_disc_is_neo_hookean_and_slides() -> None:
    law = disc(5.5e-3, 2e-3, 40e6)
    area, stretch = np.pi * 2.75e-3**2, 0.5  # lam^-2 - lam = 3.5
    assert np.interp(1e-3, law.compression, law.force) == pytest.approx(3.5 * 40e6 * area, rel=1e-3)
    first = law.force[1] / law.compression[1]
    assert first == pytest.approx(3.0 * 40e6 * area / 2e-3, rel=0.01)  # E = 3 mu over the height
    assert law.compression[-1] == pytest.approx(2e-3 * 0.8)
    assert stretch == 1.0 - 1e-3 / 2e-3


def test_the_faces_close_by_the_waves_of_equal_bars() -> None:
    """A constant force f from t = 0: v = V - 2 f / Z until the striker's rear answers, then V - 4 f / Z."""
    time, f = np.linspace(0.0, 1.5e-4, 3001), 1000.0
    force = np.full(len(time), f)
    found = closing(time, force, striker=STRIKER, incident=BAR, speed=SPEED)
    T, Z = 2.0 * STRIKER.travel_time, BAR.impedance
    before = SPEED - 2.0 * f / Z
    exact = before * time - np.maximum(time - T, 0.0) * 2.0 * f / Z
    np.testing.assert_allclose(found, exact, atol=2.0 * f / Z * (time[1] - time[0]))  # the jump's own step


@pytest.mark.parametrize(
    "law", [loading(np.array([0.0, 2e-4]), np.array([0.0, 1e4])), disc(5.5e-3, 2e-3, 40e6)]
)
def test_a_pulse_gives_back_its_law(law: PulseShaper) -> None:
    found = from_pulse(*pulse_of(law), striker=STRIKER, incident=BAR, speed=SPEED)
    x = np.linspace(0.2, 0.95, 16) * found.compression[-1]
    exact = np.interp(x, law.compression, law.force)
    if law.compression[-1] < found.compression[-1]:  # a linear law goes on along its slope
        exact = np.interp(x, [0.0, 1.0], [0.0, 5e7])
    # Waves of whole steps: the striker's round trip is off by up to half a step in 965.
    np.testing.assert_allclose(np.interp(x, found.compression, found.force), exact, rtol=0.01)


def test_unloading_is_seen_in_the_pulse() -> None:
    law = loading(np.array([0.0, 2e-4]), np.array([0.0, 1e4]), 2e8)  # four times as stiff as loading
    found = from_pulse(*pulse_of(law), striker=STRIKER, incident=BAR, speed=SPEED)
    assert found.unloading == pytest.approx(2e8, rel=0.03)
    given = from_pulse(*pulse_of(law), striker=STRIKER, incident=BAR, speed=SPEED, unloading=3e8)
    assert given.unloading == 3e8


def test_a_pulse_that_loads_nothing_is_refused() -> None:
    time = np.linspace(0.0, 1e-4, 101)
    bars = {"striker": STRIKER, "incident": BAR}
    with pytest.raises(ValueError, match="compression-positive"):
        from_pulse(time, -1e3 * time / 1e-4, speed=SPEED, **bars)
    with pytest.raises(ValueError, match="part while the force rises"):
        from_pulse(time, 1e5 * time / 1e-4, speed=0.5, **bars)  # no striker of 0.5 m/s makes 100 kN


def table(**keys: object) -> ShaperTable:
    return ShaperTable.model_validate(keys)


def test_laws_from_files(tmp_path: Path) -> None:
    time, force = pulse_of(disc(5.5e-3, 2e-3, 40e6))
    late = 1e6 * time + 30.0  # a recorder that has begun earlier
    rows = [f"{t:.3f},{f:.4f}" for t, f in zip(late, force, strict=True)]
    (tmp_path / "pulse.csv").write_text("\n".join(["time (us),force (N)", "0.0,0.0", *rows]))
    bars = {"striker": STRIKER, "incident": BAR}
    declared = table(kind="pulse", file="pulse.csv", speed="5.5 m/s")
    found = shaper_of(declared, tmp_path, **bars)
    assert found is not None
    exact = disc(5.5e-3, 2e-3, 40e6)
    x = 0.7e-3
    want = np.interp(x, exact.compression, exact.force)
    assert np.interp(x, found.compression, found.force) == pytest.approx(want, rel=0.03)
    (tmp_path / "law.csv").write_text("compression (mm),force (N)\n0,0\n0.5,100\n1,400\n")
    law = shaper_of(table(kind="table", file="law.csv"), tmp_path, **bars)
    assert law.unloading == pytest.approx(300.0 / 0.5e-3)
    (tmp_path / "law.csv").write_text("compression (mm),force (N)\n0,0\n0.5,100\n1,50\n")
    with pytest.raises(InputError, match="ascend"):
        shaper_of(table(kind="table", file="law.csv"), tmp_path, **bars)
    assert shaper_of(table(kind="none"), tmp_path, **bars) is None


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"kind": "disc", "diameter": "5 mm", "height": "2 mm"}, "is missing"),
        ({"kind": "none", "height": "2 mm"}, "has no effect"),
        ({"kind": "table", "file": "a.csv", "speed": "5 m/s"}, "has no effect"),
        ({"kind": "none", "unloading": "1e8 N/m"}, "has no effect"),
    ],
)
def test_keys_that_do_not_go_with_the_kind(keys: dict, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        table(**keys)
