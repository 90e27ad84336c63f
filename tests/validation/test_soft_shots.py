"""Forces, clocks and events of the known-answer flyer shots against their truth."""

import json
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from shared_data import data

from kolsky.bars.flyer.events import flyer_events
from kolsky.bars.flyer.path import FlyerPath, fit_flyer, path_strain
from kolsky.bars.flyer.synchronisation import Agreement, synchronise
from kolsky.bars.records import History, Quantity, Signal
from kolsky.bars.reduction import inertia
from kolsky.bars.reduction.validity import Reason, validity
from kolsky.base.apparatus import Specimen
from kolsky.base.arrays import FloatArray
from kolsky.base.records import FlyerMotion

STATIC = 12
SIGMA_FLYER = 1e-6
"""Static frames scatter by 0.6 um, moving ones by 0.9 um about a smooth curve (runs/open-01/shot.toml)."""
RAMP = {"open-01": (37.5e-6, 87.5e-6), "open-02": (37.5e-6, 97.5e-6)}
"""Beginning and end of the flyer's ramp [s], from truth.json and the shape of d(t)."""


@dataclass(frozen=True)
class SoftShot:
    """One shot: what was recorded, and the truth beside it."""

    incident: Signal
    transmitted: Signal
    sigma_zero: float  # standard uncertainty of the incident force's zero [N]
    motion: FlyerMotion
    path: FlyerPath
    specimen: Specimen
    mass: Quantity
    truth: dict[str, FloatArray]

    @property
    def rest(self) -> float:
        """Last static frame [s]."""
        return float(self.motion.time[STATIC - 1])

    def times(self) -> FloatArray:
        """Scope samples at which flyer and truth are known too [s]."""
        t = self.incident.time
        return t[(t >= self.path.start) & (t <= min(self.path.end, self.truth["t_force"][-1]))]

    def at(self, signal: Signal, time: FloatArray) -> History:
        """A signal at some of its own samples."""
        row = np.rint((time - signal.start) / signal.interval).astype(int)
        return History(signal.value[row], np.full(time.size, signal.sigma), signal.unit)

    def true(self, name: str, time: FloatArray) -> FloatArray:
        """A true force; zero before the motion."""
        return np.interp(time, self.truth["t_force"], self.truth[name].astype(float), left=0.0)


@cache
def soft_shot(folder: Path) -> SoftShot:
    """Read a shot's records."""
    facts = json.loads((folder / "facts.json").read_text())
    volts = np.loadtxt(folder / "scope.csv", delimiter=",", skiprows=1)
    interval = 0.5e-6
    start = float(volts[0, 0])
    time = start + interval * np.arange(len(volts))
    rest = time < 0.0
    signals = []
    for column, name in ((1, "incident"), (2, "transmitted")):
        force = volts[:, column] / facts["scope"]["sensitivity_V_per_N"][name]
        zero, noise = float(force[rest].mean()), float(force[rest].std(ddof=1))
        signals.append(Signal(start, interval, force - zero, noise, "N", name))
    table = np.loadtxt(folder / "flyer.csv", delimiter=",", skiprows=1)
    motion = FlyerMotion(table[:, 1], 1e-3 * table[:, 2], np.full(len(table), SIGMA_FLYER))
    size = facts["specimen"]
    with np.load(folder / "truth_surface.npz") as file:
        truth = {name: file[name] for name in ("t", "d", "t_force", "incident", "transmitted")}
    return SoftShot(
        incident=signals[0],
        transmitted=signals[1],
        sigma_zero=signals[0].sigma / float(np.sqrt(rest.sum())),
        motion=motion,
        path=fit_flyer(motion, start=float(motion.time[STATIC - 1])),
        specimen=Specimen(1e-3 * size["diameter_mm"], 1e-3 * size["length_mm"], size["density_kg_m3"]),
        mass=Quantity("platen", facts["platens"]["mass_between_sensor_and_specimen_kg"], 0.0, "kg", "B"),
        truth=truth,
    )


SHOTS = ("open-01", "open-02")


@pytest.fixture(params=SHOTS)
def shot(request) -> SoftShot:
    return soft_shot(data("shots", request.param))


@pytest.fixture
def ramp(request, shot) -> tuple[float, float]:
    return RAMP[request.node.callspec.params["shot"]]


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def front_force(shot, time):
    """The incident force after mass compensation."""
    gauge = shot.at(shot.incident, time)
    return inertia.compensate_mass(gauge, inertia.path_acceleration(shot.path, time), shot.mass)


def test_the_transmitted_force_is_within_its_noise(shot):
    t = shot.times()
    found = shot.at(shot.transmitted, t)
    score = (found.value - shot.true("transmitted", t)) / found.sigma
    # The sigma is known from 400 samples to 3.5 %, chi-square to 7 % by it and to 2.6 % by its own scatter.
    assert np.mean(score**2) == pytest.approx(1.0, abs=3 * 0.075)
    assert abs(score.mean()) < 3 / np.sqrt(400)  # the zero is from 400 samples
    assert abs(np.corrcoef(score[1:], score[:-1])[0, 1]) < 0.1  # white; 2880 samples: 0.019 each


def test_the_incident_force_after_mass_compensation(shot, ramp):
    """Within 1 N rms after the ramp, where the mass alone felt 700 N and still feels decelerations."""
    t = shot.times()
    found, log = front_force(shot, t)
    error = found.value - shot.true("incident", t)
    after = t > ramp[1] + 10e-6  # one frame's interval: the ramp of a path ends within it
    assert rms(error[after]) < 1.0
    # Once the ramp is past the noise of the transducer itself, 0.42 N, is all there is.
    assert rms(error[t > 200e-6]) < 1.1 * shot.incident.sigma
    assert 600.0 < log.size < 800.0
    # Uncompensated: decelerations of 60 m/s^2 and more are half a newton, in the ramp it is everything.
    raw = shot.at(shot.incident, t).value - shot.true("incident", t)
    assert rms(raw[t < ramp[1]]) > 5.0 * rms(error[t < ramp[1]])


def test_the_sigma_of_the_compensated_force_covers_its_error(shot, ramp):
    t = shot.times()
    found, _ = front_force(shot, t)
    score = (found.value - shot.true("incident", t)) / found.sigma
    moving = (t > ramp[0]) & (t < ramp[1] + 20e-6)
    # Some ten frames decide the ramp, so that its rms score is known to a quarter only.
    assert 0.2 < rms(score[moving]) < 1.5
    assert rms(score[t > 200e-6]) == pytest.approx(1.0, abs=0.15)


def test_clocks_agree_as_declared(shot):
    """Both are on one clock (facts.json); 10 % of the specimen's length is travelled meanwhile."""
    found = synchronise(
        shot.motion, shot.incident, mass=shot.mass.value, rest=0.0, travel=0.1 * shot.specimen.length,
        sigma_zero=shot.sigma_zero,
    )  # fmt: skip
    assert found.agreement is Agreement.AGREES
    assert abs(found.lag) < 2 * found.sigma < 1e-6
    assert found.gain == pytest.approx(1.0, abs=0.03)  # mass and sensitivity; a specimen of 0.4 g moves along
    assert 0.6 < found.chi2_per_dof < 1.6  # 45 degrees of freedom: 0.2 each


@pytest.mark.parametrize("planted", [-41e-6, -3e-6, 7e-6, 120e-6])
def test_planted_offsets_are_recovered(shot, planted):
    late = FlyerMotion(shot.motion.time - planted, shot.motion.displacement, shot.motion.sigma)
    found = synchronise(
        late, shot.incident, mass=shot.mass.value, rest=0.0, travel=0.1 * shot.specimen.length,
        sigma_zero=shot.sigma_zero,
    )  # fmt: skip
    assert found.lag == pytest.approx(planted, abs=2 * found.sigma)
    assert found.agreement is Agreement.DIFFERS


def test_the_validity_window_of_a_soft_specimen_is_nearly_empty(shot):
    t = shot.times()
    front, _ = front_force(shot, t)
    back = shot.at(shot.transmitted, t)
    strain, rate, second = path_strain(shot.path, t, length=shot.specimen.length)
    size = shot.specimen
    radial = inertia.radial_pressure(
        strain.value, rate.value, second.value, density=size.density, radius=size.radius
    ) / (1.0 - strain.value)
    axial = inertia.axial_stress(second.value, density=size.density, length=size.length)
    for average in (0.0, 1 / 120e3, 20e-6):
        found = validity(
            t, front, back, strain, inertial_stress=radial - axial, area=size.area, average=average
        )
        assert found.nearly_empty
        # A window of so little strain is the moment at which two curves cross.
        assert found.covered < 0.03
        assert found.counts[Reason.BALANCE] > 0.6
        assert "kolsky identify" in found.sentence


def test_radial_inertia_is_a_correction_with_its_size(shot):
    """Against the formula on the true displacement, whose smooth part is a cubic of time."""
    t = shot.times()
    strain, rate, second = path_strain(shot.path, t, length=shot.specimen.length)
    force = shot.at(shot.transmitted, t)
    stress = History(force.value / shot.specimen.area, force.sigma / shot.specimen.area, "Pa")
    found, log = inertia.correct_radial_inertia(stress, strain, rate, second, shot.specimen)
    late = t > 0.3e-3
    true, displacement = shot.truth["t"], shot.truth["d"].astype(float)
    smooth = np.polynomial.Polynomial.fit(true[true > 0.12e-3], displacement[true > 0.12e-3], 3)
    e, e1, e2 = ((smooth if k == 0 else smooth.deriv(k))(t[late]) / shot.specimen.length for k in (0, 1, 2))
    by_hand = 870.0 * 4.75e-3**2 / 8 * (e2 / (1 - e) ** 3 + 1.5 * e1**2 / (1 - e) ** 4)
    # The path's second derivative is known to some 30 m/s^2 of 150: 4 % of the whole early on.
    np.testing.assert_allclose(stress.value[late] - found.value[late], by_hand, rtol=0.06)
    assert log.key == "radial inertia"
    assert log.size > 1e4  # in the ramp, where nobody reads a curve


def test_events_of_a_flight_that_the_record_cuts_off(shot, ramp):
    events = flyer_events(shot.motion, rest=shot.rest, incident=shot.incident, transmitted=shot.transmitted)
    full = events["full speed"]
    assert full.time == pytest.approx(ramp[1], abs=3 * full.sigma)
    # The motion of these shots was prescribed: there is no joint that pulls, and it ends in mid-flight.
    for name in ("separation", "arrest", "push-back", "second impact", "end of symmetry"):
        assert events[name].time is None, name
    assert "m/s at the record's end" in events["arrest"].how
    assert events.usable == (events.path.end, "the record")


def test_a_late_clock_costs_newtons(shot):
    """Why the clocks are checked: 2 us late the compensation is off by tens of newtons in the ramp."""
    t = shot.times()[20:]
    late = replace(shot.path, knots=shot.path.knots + 2e-6)
    a = inertia.path_acceleration(late, t[t <= late.end])
    gauge = shot.at(shot.incident, t[t <= late.end])
    wrong, _ = inertia.compensate_mass(gauge, a, shot.mass)
    right, _ = front_force(shot, t[t <= late.end])
    assert np.abs(wrong.value - right.value).max() > 30.0
