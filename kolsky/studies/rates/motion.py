"""The strain rate of a test: what one number stands for, and how far the rate spreads inside the test."""

from dataclasses import dataclass, replace

import numpy as np

from kolsky.bars.flyer.fit import fit_flyer
from kolsky.bars.flyer.front_path import front_path
from kolsky.bars.flyer.path import FlyerPath
from kolsky.base.arrays import FloatArray
from kolsky.base.records import FlyerMotion, FrontVelocity
from kolsky.shot.records import Shot

ONSET = 0.01
"""Nominal strain from which the test counts as running [-]."""
CENTRAL = 0.9
"""Share of the strain that the quoted range of the true rate covers."""
TIMES = 2001
"""Points of a strain history."""


@dataclass(frozen=True)
class StrainHistory:
    """Nominal strain against time while the front face moves toward the specimen, and its rate.

    The back face's own motion (a few um in a soft specimen) is not subtracted.
    """

    time: FloatArray
    """Times on the shot's clock, from the window's start to the largest strain in it [s], shape [n]."""
    strain: FloatArray
    """Nominal compressive strain, displacement over length [-], shape [n]."""
    span: tuple[float, float]
    """First time at a strain of 1 % and time of the largest strain: the part that was averaged [s]."""
    nominal_rate: float
    """Mean velocity of the front face over that part, over the specimen's length, Eq. (S.1) [1/s]."""
    sigma_rate: float
    """Its standard uncertainty from the noise of the motion and its scale [1/s]."""
    true_rate: tuple[float, float]
    """Velocity over the current length: between these lie the central 90 % of the strain [1/s]."""
    spread: float
    """Standard deviation of log10 of the true rate over the strain of the test [decade]."""

    @property
    def largest(self) -> float:
        """Largest nominal strain reached [-]."""
        return float(self.strain[-1])

    @property
    def sigma_decades(self) -> float:
        """Standard uncertainty of log10 of the rate of the test as a whole [decade]."""
        return float(np.hypot(self.spread, self.sigma_rate / (self.nominal_rate * np.log(10.0))))

    def time_at(self, strain: FloatArray) -> FloatArray:
        """First time at which a strain is reached [s], shape of `strain`.

        Raises
        ------
        ValueError
            If a strain is not positive or was not reached.
        """
        e = np.asarray(strain, dtype=float)
        bad = e[~((e > 0.0) & (e <= self.largest))]
        if bad.size:
            raise ValueError(f"a strain of {bad[0]:.4g} was not reached, the largest is {self.largest:.4g}")
        reached = np.maximum.accumulate(self.strain)
        return np.interp(e, reached, self.time)


def strain_history(shot: Shot) -> StrainHistory:
    """Strain history of a shot inside its window.

    Raises
    ------
    ValueError
        If the motion cannot be used, or the specimen is not compressed by more than 1 % in the window.
    """
    path, sigma_gain = _path(shot.flyer, shot.window[0])
    first, last = max(shot.window[0], path.start), min(shot.window[1], path.end)
    time = np.linspace(first, last, TIMES)
    return strain_history_of(path, time, shot.specimen.length, sigma_gain=sigma_gain)


def strain_history_of(
    path: FlyerPath, time: FloatArray, length: float, *, sigma_gain: float = 0.0
) -> StrainHistory:
    """Strain history of a path at given times.

    Parameters
    ----------
    path
        Motion of the front face toward the specimen.
    time
        Increasing times [s], shape [n].
    length
        The specimen's length before the test [m].
    sigma_gain
        Standard uncertainty of the scale of the motion [-].

    Raises
    ------
    ValueError
        If the specimen is not compressed by more than 1 %, or through its length.
    """
    strain = (path.position(time) - path.position(time[:1])) / length
    top = int(np.argmax(strain))
    if not ONSET < strain[top] < 1.0:
        raise ValueError(
            f"the largest nominal strain in the window is {strain[top]:.4g}, expected {ONSET:g} to 1: check"
            " the window and the unit of the front face's displacement"
        )
    onset = int(np.argmax(strain >= ONSET))
    span = float(time[onset]), float(time[top])
    seconds = span[1] - span[0]
    if seconds <= 0.0:
        raise ValueError("the specimen is compressed within one step of time: the window is too short")
    rate = float(strain[top] - strain[onset]) / seconds  # Eq. (S.1)
    noise = path.sigma_change(*span) / (length * seconds)
    part = slice(onset, top + 1)
    true = path.velocity(time[part]) / (length * (1.0 - strain[part]))
    forward = true[:-1] + true[1:] > 0.0
    middle, weight = 0.5 * (true[:-1] + true[1:])[forward], np.diff(strain[part])[forward]
    low, high, spread = _over_strain(middle, np.maximum(weight, 0.0))
    return StrainHistory(
        time=time[: top + 1],
        strain=strain[: top + 1],
        span=span,
        nominal_rate=rate,
        sigma_rate=float(np.hypot(noise, sigma_gain * rate)),
        true_rate=(low, high),
        spread=spread,
    )


def _over_strain(rate: FloatArray, weight: FloatArray) -> tuple[float, float, float]:
    """Range of the central share and standard deviation of log10, weighted by the strain passed."""
    order = np.argsort(rate)
    passed = np.cumsum(weight[order])
    passed = (passed - 0.5 * weight[order]) / passed[-1]
    low, high = np.interp([0.5 - 0.5 * CENTRAL, 0.5 + 0.5 * CENTRAL], passed, rate[order])
    log = np.log10(rate)
    mean = np.average(log, weights=weight)
    return float(low), float(high), float(np.sqrt(np.average((log - mean) ** 2, weights=weight)))


def _path(motion: FlyerMotion | FrontVelocity, start: float) -> tuple[FlyerPath, float]:
    """The path that the identification used, and the uncertainty of its scale."""
    if isinstance(motion, FlyerMotion):
        return fit_flyer(motion, start=start), 0.0
    return front_path(replace(motion, sigma_gain=0.0)), motion.sigma_gain
