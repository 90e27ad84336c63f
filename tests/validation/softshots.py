"""The scope and flyer records of the known-answer shots, as signals with their noise."""

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from kolsky.bars.flyer.path import FlyerPath, fit_flyer
from kolsky.bars.records import History, Quantity, Signal
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
    sigma_zero: float
    """Standard uncertainty of the incident force's zero [N]."""
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
