"""Events of synthetic flights, compared with their times in closed form."""

import numpy as np
import pytest
from softflyer import Flight

from kolsky.bars.flyer.events import find_kink, flyer_events
from kolsky.bars.records import Signal
from kolsky.base.apparatus import Bar

REST = 20e-6
ARREST, IMPACT, END = 900e-6, 1500e-6, 1700e-6
FLIGHT = Flight(pull=60e-6, loss=0.5, arrest=ARREST, impact=IMPACT)


def transmitted(seed=0):
    """A bell around the arrest, 100 N high."""
    t = -200e-6 + 0.5e-6 * np.arange(3900)
    clean = 100.0 / np.cosh((t - ARREST) / 200e-6)
    return Signal(
        -200e-6, 0.5e-6, clean + 0.2 * np.random.default_rng(seed).standard_normal(t.size), 0.2, "N"
    )


BAR = Bar(diameter=15e-3, length=3.0, youngs_modulus=190e9, density=8048.0)


@pytest.fixture(scope="module")
def everything():
    return flyer_events(
        FLIGHT.motion(0, END),
        rest=REST,
        incident=FLIGHT.force(0, END),
        transmitted=transmitted(),
        bar=BAR,
        ringing=10e-6,
    )


def near(event, time, sigmas=3.0):
    assert event.time == pytest.approx(time, abs=sigmas * event.sigma), event


def test_every_event_with_all_instruments(everything):
    near(everything["full speed"], FLIGHT.full)
    near(everything["separation"], FLIGHT.full + FLIGHT.pull)
    # Relative to a back face that moves with F / Z (the first echo is 1.2 ms away) it stands still earlier.
    deceleration = 2.1 / 300e-6
    near(everything["arrest"], ARREST - 100.0 / BAR.impedance / deceleration)
    near(everything["push-back"], ARREST + 200e-6 * np.arccosh(2.0))
    near(everything["second impact"], IMPACT)
    # Sigmas are worth something: frames are 8.3 us apart.
    assert everything["arrest"].sigma < 2e-6
    assert everything["second impact"].sigma < 2e-6
    assert everything["separation"].sigma < 5e-6
    order = ("full speed", "separation", "arrest", "push-back", "second impact")
    assert sorted(order, key=lambda name: everything[name].time) == list(order)
    assert everything.usable == (everything["second impact"].time, "second impact")
    assert everything.path.end < IMPACT
    with pytest.raises(KeyError, match="is not one of"):
        everything["landing"]


def test_a_displacement_alone(everything):
    events = flyer_events(FLIGHT.motion(1, END), rest=REST)
    near(events["separation"], FLIGHT.full + FLIGHT.pull)
    assert "displacement" in events["separation"].how
    near(events["arrest"], ARREST)
    near(events["second impact"], IMPACT)
    assert events["push-back"].time is None
    assert "transmitted force" in events["push-back"].how
    assert events["end of symmetry"].time is None
    assert "pictures" in events["end of symmetry"].how


def test_what_did_not_happen_is_not_found():
    still = Flight()
    events = flyer_events(still.motion(2, 450e-6), rest=REST, incident=still.force(2, 450e-6))
    near(events["full speed"], still.full)
    for name in ("separation", "arrest", "push-back", "second impact"):
        assert events[name].time is None
        assert events[name].how
    assert "2.6 m/s" in events["arrest"].how
    assert events.usable[1] == "the record"


def test_a_bar_needs_the_transmitted_force():
    motion = Flight().motion(3, 300e-6)
    with pytest.raises(ValueError, match="give both or neither"):
        flyer_events(motion, rest=REST, bar=BAR)


def test_a_kinks_time_has_the_scatter_it_says():
    t = np.linspace(0.0, 1.0, 60)
    rng = np.random.default_rng(4)
    score, gains = [], []
    for _ in range(30):
        clean = 1.0 + t + 3.0 * np.maximum(t - 0.43, 0.0)
        kink = find_kink(
            t,
            clean + 0.05 * rng.standard_normal(60),
            np.full(60, 0.05),
            (0.1, 0.9),
            degree=1,
            power=1,
            begins=True,
        )
        score.append((kink.time - 0.43) / kink.sigma)
        straight = find_kink(
            t,
            1.0 + t + 0.05 * rng.standard_normal(60),
            np.full(60, 0.05),
            (0.1, 0.9),
            degree=1,
            power=1,
            begins=True,
        )
        gains.append(straight.gain)
        assert kink.change == pytest.approx(3.0, abs=0.4)
        assert kink.gain > 100.0
    assert 0.7 < np.sqrt(np.mean(np.square(score))) < 1.35  # 30 scores: 1 within 0.13
    assert max(gains) < 25.0  # chi-square of two: 1 in 10^5 reaches 25
    with pytest.raises(ValueError, match="needs at least"):
        find_kink(t[:5], t[:5], t[:5], (0.0, 1.0), degree=1, power=1, begins=True)
    with pytest.raises(ValueError, match="span"):
        find_kink(t, t, t + 1, (1.0, 1.0), degree=1, power=1, begins=True)
