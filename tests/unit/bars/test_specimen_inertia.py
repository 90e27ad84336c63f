"""Inertia of a specimen between bars, against closed forms of a constantly accelerated compression."""

from dataclasses import replace

import numpy as np
import pytest
from barshots import bar_shot

from kolsky.bars.audit import CORRECTIONS, AuditLog, Switches
from kolsky.bars.records import History, Reduction
from kolsky.bars.reduction.inertia import (
    axial_by_analysis,
    correct_inertia,
    corrections_that_act,
    inertial_share,
    specimen_motion,
    valid_span,
)
from kolsky.bars.reduction.validity import Reason
from kolsky.base.apparatus import Bar, Specimen
from kolsky.base.errors import InputError
from kolsky.shot.bars import load_waves
from kolsky.shot.waves import waves

STEP, N = 1e-7, 2000
BAR = Bar(diameter=0.02, length=2.0, youngs_modulus=200e9, density=8000.0)  # 4 us across: 41 samples
BARS = {"incident": BAR, "transmission": BAR}
RUBBER = Specimen(diameter=0.01, length=0.004, density=1000.0)
PULL, BACK = 5e6, 2e4
"""e'' [1/s^2] and the back face's acceleration [m/s^2]."""
AXIAL = 1000.0 * 0.004**2 * PULL / 12.0
"""What axial inertia takes from the mean of both faces' stresses: 6.7 kPa."""
INSIDE = slice(50, -50)
"""Beyond the ends of the averages."""


def reduction(stress: float = 1e6) -> Reduction:
    """e = e'' t^2 / 2, up to 0.1; the same stress at both faces."""
    t = STEP * np.arange(N)
    quiet = np.zeros(N)
    held = np.full(N, stress)

    def of(value: np.ndarray, unit: str, sigma: float = 0.0) -> dict[str, History]:
        history = History(value, np.full(N, sigma), unit)
        return dict.fromkeys(("one wave", "two waves", "three waves"), history)

    force = History(held * RUBBER.area, quiet, "N")
    return Reduction(
        time=t,
        strain=of(0.5 * PULL * t**2, "1"),
        rate=of(PULL * t, "1/s"),
        stress=of(held, "Pa", 1e3),
        front_force=force,
        back_force=force,
        front_velocity=History(PULL * t * RUBBER.length + BACK * t, quiet, "m/s"),
        back_velocity=History(BACK * t, quiet, "m/s"),
        imbalance=quiet,
        balanced=(0.0, float(t[-1])),
    )


def pressure() -> np.ndarray:
    """Kolsky's pressure at finite strain over the grown face, in nominal stress."""
    t = STEP * np.arange(N)
    e, e1 = 0.5 * PULL * t**2, PULL * t
    a0, left = 0.005, 1.0 - e
    return 1000.0 * a0**2 / 8.0 * (PULL / left**2 + 1.5 * e1**2 / left**3) / left


def test_the_motion_is_that_of_the_faces():
    motion = specimen_motion(reduction(), BARS)
    t = STEP * np.arange(N)
    np.testing.assert_allclose(motion.rate.value[INSIDE], (PULL * t)[INSIDE], rtol=1e-9, atol=1e-6)
    np.testing.assert_allclose(motion.second.value[INSIDE], PULL, rtol=1e-6)
    np.testing.assert_allclose(motion.back.value[INSIDE], BACK, rtol=1e-6)


def test_the_noise_of_the_second_derivative_is_that_of_two_means():
    """Of 20 000 white samples of 1 1/s, a central difference of means of 41 scatters by 1 / (41 step)."""
    noise = np.random.default_rng(2).standard_normal(20_000)
    one = History(noise, np.ones(noise.size), "1/s")
    long = replace(
        reduction(),
        time=STEP * np.arange(noise.size),
        rate={"three waves": one},
        back_velocity=History(noise, np.ones(noise.size), "m/s"),
    )
    motion = specimen_motion(long, BARS)
    assert motion.second.sigma[0] == pytest.approx(1.0 / (41 * STEP), rel=1e-12)
    assert motion.second.value[50:-50].std() == pytest.approx(motion.second.sigma[0], rel=0.05)
    assert motion.rate.value[50:-50].std() == pytest.approx(motion.rate.sigma[0], rel=0.1)


def test_axial_inertia_is_the_momentum_of_the_layers():
    """Force at the height Y is the back one plus what lies below it times its acceleration; mean over Y."""
    Y = np.linspace(0.0, RUBBER.length, 2001)
    force = 1000.0 * (BACK * Y + 0.5 * PULL * Y**2)  # above the back face, per area
    mean, front = np.trapezoid(force, Y) / RUBBER.length, force[-1]
    found = axial_by_analysis(PULL, RUBBER, BACK)
    assert found["one wave"] == pytest.approx(mean, rel=1e-6)
    assert found["two waves"] == pytest.approx(mean - front, rel=1e-6)
    assert found["three waves"] == pytest.approx(mean - 0.5 * front, rel=1e-5)
    assert found["three waves"] == pytest.approx(-AXIAL, rel=1e-12)


@pytest.mark.parametrize("key", ["radial inertia", "axial inertia"])
@pytest.mark.parametrize("way", ["one wave", "two waves", "three waves"])
def test_what_is_on_acts_on_every_analysis(key, way):
    plain = reduction()
    found, log = correct_inertia(plain, RUBBER, BARS, {key: "on, as the shot states"})
    wanted = (
        -pressure() if key == "radial inertia" else np.full(N, axial_by_analysis(PULL, RUBBER, BACK)[way])
    )
    change = found.stress[way].value - plain.stress[way].value
    np.testing.assert_allclose(change[INSIDE], wanted[INSIDE], rtol=1e-5)
    assert {entry.key: entry.applied for entry in log} == {
        name: name == key for name in ("radial inertia", "axial inertia")
    }
    same, _ = correct_inertia(plain, RUBBER, BARS, {key: "off by default"})
    assert same is plain


def test_a_specimen_is_soft_from_the_limit_on():
    """Radial pressure up to 28.6 kPa at the end, where the means end, and 6.7 kPa of axial inertia."""
    top = float(pressure()[-21]) + AXIAL
    just, hard = reduction(top / 0.055), reduction(top / 0.045)
    assert inertial_share(just, RUBBER, BARS) == pytest.approx(0.055, rel=0.02)
    for given, on in ((just, True), (hard, False)):
        acts = corrections_that_act(given, RUBBER, BARS, Switches(), share=0.05)
        assert acts["radial inertia"].startswith("on: the specimen is soft" if on else "off by default")
        assert acts["axial inertia"].startswith("off by default")
    stated = Switches({"radial_inertia": False, "axial_inertia": True})
    acts = corrections_that_act(just, RUBBER, BARS, stated, share=0.05)
    assert [acts[key].split(",")[0] for key in acts] == ["off", "on"]


def test_the_valid_span_ends_where_inertia_begins_to_count():
    given, added = reduction(1e6), pressure() + AXIAL
    limit = 0.03
    span = valid_span(given, RUBBER, BARS, share=limit, tension=False)
    assert span.window is not None
    ends = STEP * int(np.argmax(added > limit * 1e6))
    assert span.window[1] == pytest.approx(ends, abs=4e-6)  # intervals of 4 us
    assert span.end_reason is Reason.INERTIA


def test_a_pulled_specimen_has_the_same_span():
    given = reduction(1e6)

    def turned(history: History) -> History:
        return replace(history, value=-history.value)

    pulled = replace(
        given,
        strain={k: turned(h) for k, h in given.strain.items()},
        rate={k: turned(h) for k, h in given.rate.items()},
        stress={k: turned(h) for k, h in given.stress.items()},
        front_force=turned(given.front_force),
        back_force=turned(given.back_force),
        back_velocity=turned(given.back_velocity),
    )
    span = valid_span(pulled, RUBBER, BARS, share=0.05, tension=True)
    assert span.window is not None
    assert span.strain[1] > 0.0


def test_every_correction_is_in_the_log(tmp_path):
    """Applied or left out, each with its reason; a heavy specimen gets radial inertia unasked."""
    result = waves(bar_shot(tmp_path / "shot", density=20000.0, more='specimen_density = "2 %"'))
    assert {entry.key for entry in result.corrections} == set(CORRECTIONS)
    log = {entry.key: entry for entry in result.corrections}
    assert log["radial inertia"].applied
    assert "the specimen is soft" in log["radial inertia"].reason
    assert not log["mass"].applied
    assert "carried to the face with the inertia of the bar" in log["mass"].reason
    assert "inertia" in result.validity
    assert result.valid is not None
    rows = {row.quantity.name: row for row in result.budget.contributions}
    assert rows["specimen, density"].quantity.sigma == pytest.approx(400.0)
    assert rows["specimen, density"].shares["peak stress"] > 0.0


@pytest.mark.parametrize(
    ("key", "named"),
    [
        ("mass = true", "nothing lies between a bar's face and the specimen"),
        ("droop = true", "a strain gauge does not discharge"),
        ("separation = true", r"add \[gauges.incident_far\]"),
    ],
)
def test_what_cannot_act_is_refused(tmp_path, key, named):
    folder = bar_shot(tmp_path / "shot", corrections=key)
    with pytest.raises(InputError, match=named):
        load_waves(folder)
    off = bar_shot(tmp_path / "off", corrections=key.replace("true", "false"))
    assert load_waves(off).switches[key.split()[0]] is False


def test_the_log_is_completed_by_what_has_no_entry():
    log = AuditLog()
    log.compare("x", "punching", [0.0], [1.0], applied=True, unit="1", reason="made up")
    log.complete({"punching": "is there", "mass": "no mass"})
    assert [(entry.key, entry.applied, entry.reason) for entry in log.corrections] == [
        ("punching", True, "made up"),
        ("mass", False, "no mass"),
    ]
