"""A synthetic classical record of a rubber between aluminium bars, computed with the package's solver."""

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

import explicit
from explicit.materials import marlow_from_curve
from kolsky.bars.flyer.front_path import BarForce, back_force
from kolsky.bars.records import FaceWaves, History, Reduction
from kolsky.bars.reduction.windows import StationInput, WavesInput
from kolsky.bars.signals.bridge import Linear
from kolsky.base.apparatus import Bar, Interface, Specimen
from kolsky.base.arrays import FloatArray
from kolsky.base.records import ForceHistory, MaterialCurve, Recording
from kolsky.shot.load import driven_by_waves
from kolsky.shot.records import ModelSettings, Shot, ShotBase

BAR = Bar(diameter=12.7e-3, length=1.5, youngs_modulus=70e9, density=2700.0)
SPECIMEN = Specimen(diameter=8e-3, length=4e-3, density=1100.0)
MODULUS, POISSON, DAMPING = 2e6, 0.495, 5e-6
FACTOR = 1.2
SPEED, RISE, PULSE = 9.0, 40e-6, 200e-6
END, INTERVAL = 260e-6, 0.5e-6
GAUGES, ARRIVAL = {"incident": 0.75, "transmission": 0.5}, 400e-6
"""Distances of the gauges from the specimen [m], and time of the wave at the specimen on the shot's clock
[s]."""
NOISE = 2e-7  # noise of a strain. The transmitted pulse has a strain of 2e-5.
SCALE = 0.01  # standard uncertainty of a strain's scale


def front(time: FloatArray) -> FloatArray:
    """Velocity of the front face: a smooth rise, a plateau and a smooth fall."""
    up, down = np.clip(time / RISE, 0.0, 1.0), np.clip((time - PULSE) / RISE, 0.0, 1.0)
    return SPEED * (up**3 * (10 - 15 * up + 6 * up**2)) * (1 - down**3 * (10 - 15 * down + 6 * down**2))


def curve() -> MaterialCurve:
    """Neo-Hookean compression to 75 %, noise 0.2 %."""
    stretch = np.linspace(1.0, 0.25, 61)
    stress = MODULUS / 3.0 * (stretch - stretch**-2)
    return MaterialCurve(stretch, stress, np.hypot(0.002 * stress, 1.0))


@dataclass(frozen=True)
class Truth:
    """Waves in the bars, without noise."""

    time: FloatArray
    front_velocity: FloatArray
    front_force: FloatArray
    back_force: FloatArray
    position: FloatArray


@cache
def truth(mesh: tuple[int, int] = (20, 20)) -> Truth:
    """The specimen between the bars, by `explicit` alone."""
    fine = np.arange(0.0, END + 1e-9, 1e-8)
    velocity = front(fine)
    position = np.concatenate([[0.0], np.cumsum(0.5 * (velocity[1:] + velocity[:-1])) * 1e-8])
    material = curve()
    model = explicit.Model(
        mesh=explicit.cylinder(
            SPECIMEN.radius, SPECIMEN.length, n_radial=mesh[0], n_axial=mesh[1], grading=2.0
        ),
        density=SPECIMEN.density,
        materials=(marlow_from_curve(material.stretch, material.stress),),
        motions=(explicit.PlatenMotion(start=0.0, step=1e-8, position=position, velocity=velocity),),
        faces="rough",
        side="rough",
        support=explicit.CharacteristicBar(impedance=BAR.impedance, round_trip=BAR.round_trip),
        damping_kind="deviatoric",
        past_data="continue",
        element="one_point",
        hourglass_form="stiffness",
    )
    time = INTERVAL * np.arange(round(END / INTERVAL) + 1)
    response = explicit.run(
        model,
        explicit.Samples.of(stiffness_factor=FACTOR, poisson=POISSON, damping=DAMPING),
        explicit.Sampling(force_times=time, surface_times=time[::40]),
    )
    assert response.outcomes[0].ok
    return Truth(
        time, front(time), response.force_flyer[0], response.force_transmission[0],
        np.interp(time, fine, position),
    )  # fmt: skip


def strains() -> tuple[FloatArray, FloatArray, FloatArray]:
    """Incident, reflected and transmitted strain at the specimen, without noise."""
    true, c0, stiffness = truth(), BAR.wave_speed, BAR.impedance * BAR.wave_speed
    return (
        0.5 * (true.front_force / stiffness + true.front_velocity / c0),
        0.5 * (true.front_force / stiffness - true.front_velocity / c0),
        true.back_force / stiffness,
    )


def gauges(seed: int) -> WavesInput:
    """Records of gauges on bars without dispersion. After the end of the truth the strains decay."""
    bar = replace(BAR, poisson=0.0)
    t, rng = INTERVAL * np.arange(3000), np.random.default_rng(seed)

    def wave(strain: FloatArray, delay: float) -> FloatArray:
        since = t - ARRIVAL - delay
        after = strain[-1] * np.exp(-np.maximum(since - END, 0.0) / 200e-6)
        return np.where(since <= END, np.interp(since, truth().time, strain, left=0.0), after)

    incident, reflected, transmitted = strains()
    seen = {side: distance / bar.wave_speed for side, distance in GAUGES.items()}
    signals = {
        "incident": wave(incident, -seen["incident"]) + wave(reflected, seen["incident"]),
        "transmission": wave(transmitted, seen["transmission"]),
    }
    stations = {}
    for side, signal in signals.items():
        noisy = signal + NOISE * rng.standard_normal(t.size)
        recording = Recording(t, noisy, side, "1", Path("scope.csv"), "0" * 64)
        stations[side] = StationInput((recording,), Linear(1.0, "1"), GAUGES[side], (10e-6, 200e-6), 0.0, 1)
    return WavesInput(
        "made-up bars", SPECIMEN, {"incident": bar, "transmission": bar}, stations,
        uncertainty={"gauge_calibration": SCALE},
    )  # fmt: skip


def record(seed: int, *, scale: float = SCALE) -> tuple[Reduction, FaceWaves]:
    """The waves at the specimen with noise and a wrong scale, and their reduction."""
    rng, true = np.random.default_rng(seed), truth()
    c0, stiffness = BAR.wave_speed, BAR.impedance * BAR.wave_speed  # E A = Z c0
    gain = 1.0 + scale * rng.standard_normal(2)
    incident, reflected, transmitted = (
        wave * gain[k // 2] + NOISE * rng.standard_normal(wave.size) for k, wave in enumerate(strains())
    )
    time = true.time

    def history(value: FloatArray, noise: float, unit: str) -> History:
        return History(value, np.hypot(noise, scale * value), unit)

    waves = FaceWaves(
        time,
        incident,
        reflected,
        transmitted,
        {name: NOISE for name in ("incident", "reflected", "transmitted")},
        BAR,
        BAR,
    )
    v1, v2 = c0 * (incident - reflected), c0 * transmitted
    F1, F2 = stiffness * (incident + reflected), stiffness * transmitted
    area, length = SPECIMEN.area, SPECIMEN.length
    rate = history((v1 - v2) / length, np.sqrt(3.0) * c0 * NOISE / length, "1/s")
    strain = np.concatenate([[0.0], np.cumsum(0.5 * (rate.value[1:] + rate.value[:-1])) * INTERVAL])
    with np.errstate(divide="ignore", invalid="ignore"):
        imbalance = np.where(F1 + F2 > 10.0, 2.0 * (F1 - F2) / (F1 + F2), np.inf)
    reduction = Reduction(
        time=time,
        strain={"three waves": history(strain, 1e-5, "1")},
        rate={"three waves": rate},
        stress={"one wave": history(F2 / area, stiffness * NOISE / area, "Pa")},
        front_force=history(F1, np.sqrt(2.0) * stiffness * NOISE, "N"),
        back_force=history(F2, stiffness * NOISE, "N"),
        front_velocity=history(v1, np.sqrt(2.0) * c0 * NOISE, "m/s"),
        back_velocity=history(v2, c0 * NOISE, "m/s"),
        imbalance=imbalance,
        balanced=None,
    )
    return reduction, waves


def base() -> ShotBase:
    """The test without its motion."""
    return ShotBase(
        name="made-up bars",
        folder=Path("made-up"),
        specimen=SPECIMEN,
        interface=Interface(faces="rough", side="rough"),
        support="bar",
        transmission_bar=BAR,
        model=ModelSettings(poisson=POISSON, damping=DAMPING, damping_kind="deviatoric", mass_damping=0.0),
        force=BarForce(ForceHistory(np.arange(2.0), np.zeros(2), np.ones(2)), 0.0),
        curve=curve(),
        inputs={},
    )


def classical_shot(seed: int, *, scale: float = SCALE, end: float | None = None) -> Shot:
    """The record as a shot for the inverse method."""
    reduction, waves = record(seed, scale=scale)
    whole = replace(base(), force=BarForce(*back_force(reduction, waves)))
    return driven_by_waves(whole, reduction, waves, end=end)
