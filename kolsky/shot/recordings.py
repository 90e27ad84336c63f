"""Recordings of a shot for its report: force channel, flyer and its path, a pair of its pictures."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from kolsky.bars.flyer.front_path import BarForce
from kolsky.base.arrays import FloatArray
from kolsky.base.records import FlyerMotion
from kolsky.pictures.picture_set import PicturePair, picture_pair
from kolsky.schema.shot_file import Source, shot_toml
from kolsky.shot.records import Shot

PATH_POINTS = 801
"""Number of times at which the fitted path is drawn."""
DIC_PAGE = "dic.html"
"""The page of `kolsky dic`. It is linked if it is in the report's folder."""


@dataclass(frozen=True)
class MotionShown:
    """Motion of the front face, measured and fitted, on the shot's clock."""

    measured_time: FloatArray
    """Times of the frames, or of the samples of the bar's face [s], shape [n]."""
    measured: FloatArray
    """Displacement toward the specimen since rest [m], or velocity [m/s], shape [n]."""
    sigma: FloatArray
    """Standard deviation of each, as declared or measured, shape [n]."""
    is_velocity: bool
    """True if `measured` is a velocity."""
    time: FloatArray
    """Times of the fitted path [s], shape [m]."""
    position: FloatArray
    """Its displacement [m], shape [m]."""
    velocity: FloatArray
    """Its velocity [m/s], shape [m]."""
    velocity_sigma: FloatArray
    """Standard uncertainty of the velocity [m/s], shape [m]."""
    residual: FloatArray
    """Measured minus fitted, in the unit of `measured`; NaN before the path begins, shape [n]."""


@dataclass(frozen=True)
class ShotRecordings:
    """The recordings of an identified shot, for its report."""

    time: FloatArray
    """Sample times of the force channel on the shot's clock [s], shape [k]."""
    value: FloatArray
    """The channel in `unit` as recorded, shape [k]."""
    unit: str
    """"V" for a transducer, "N" if the force comes from the bar's waves."""
    baseline: tuple[float, float] | None
    """Window for zero and noise [s]. None if the force comes from waves."""
    zero: float
    """Mean of the baseline, in `unit`."""
    window: tuple[float, float]
    """First and last time that is simulated and compared [s]."""
    symmetry_end: float | None
    """Time at which the flyer leaves its first direction [s]; None if it does not, or is unknown."""
    motion: MotionShown
    """The flyer, or the bar's face."""
    surface: dict[str, str] = field(default_factory=dict)
    """Result of the image correlation, in words; empty if no pictures were correlated."""
    surface_file: str = ""
    """The file with these numbers, in the report's folder."""
    surface_page: str = ""
    """The page about them, in the report's folder; empty if there is none."""
    numbers: dict[str, float] = field(default_factory=dict)
    """The numbers of the surfaces by name, from `kolsky.pictures.summary.numbers`; empty without surfaces."""
    pair: PicturePair | str = ""
    """A pair of pictures with the points drawn on it, or the reason why there is none."""


def shot_recordings(shot: Shot, folder: Path) -> ShotRecordings:
    """The recordings of a shot for its report.

    ``folder``: the folder of its results. Raises InputError if its pictures were correlated but the result
    file cannot be read. Raises ValueError if the flyer's record cannot be used.
    """
    channel = shot.force
    if isinstance(channel, BarForce):
        time, value, unit, baseline, zero = channel.time, channel.raw_force(), "N", None, 0.0
    else:
        time, value, unit = channel.time, channel.recording.value, channel.recording.unit
        baseline, zero = channel.baseline, float(channel.baseline_volts().mean())
    return ShotRecordings(
        time=time,
        value=value,
        unit=unit,
        baseline=baseline,
        zero=zero,
        window=shot.window,
        symmetry_end=shot.symmetry_end,
        motion=_motion(shot),
        # There are no pictures if bars are the only instruments, or if no shot file was read.
        **(surface_of(shot.file, folder) if shot.file and isinstance(shot.flyer, FlyerMotion) else {}),
    )


def recording_facts(shot: Shot) -> dict[str, Any]:
    """The numbers used to read the force and the flyer, for `provenance`; SI, JSON types."""
    window = {"window_start_s": shot.window[0], "window_end_s": shot.window[1]}
    symmetry = {} if shot.symmetry_end is None else {"symmetry_end_s": shot.symmetry_end}
    motion = shot.flyer
    if isinstance(motion, FlyerMotion):
        moved = {"frames": int(motion.time.size), "flyer_sigma_m": float(np.median(motion.sigma))}
    else:
        moved = {"front_noise_m_per_s": motion.noise, "front_samples": int(motion.time.size)}
    channel = shot.force
    if isinstance(channel, BarForce):
        force: dict[str, Any] = {"force_from": "waves in the transmission bar"}
    else:
        rest = channel.baseline_volts()
        force = {
            "force_from": "transducer",
            "channel": channel.recording.channel,
            "sampling_interval_s": float(np.median(np.diff(channel.time))),
            "baseline_s": list(channel.baseline),
            "baseline_V": float(rest.mean()),
            "noise_V": float(rest.std(ddof=1)),
            "sensitivity_V_per_N": channel.transducer.sensitivity,
            "compression": "positive volts" if channel.transducer.compression_sign > 0 else "negative volts",
            "clock_offset_s": channel.clock_offset,
        }
    return {**force, **moved, **window, **symmetry}


def _motion(shot: Shot) -> MotionShown:
    path = shot.flyer_path
    grid = np.linspace(path.start, path.end, PATH_POINTS)
    motion = shot.flyer
    inside = (motion.time >= path.start) & (motion.time <= path.end)
    residual = np.full(motion.time.size, np.nan)
    if isinstance(motion, FlyerMotion):
        measured, sigma = motion.displacement - path.zero, motion.sigma
        residual[inside] = measured[inside] - path.position(motion.time[inside])
    else:
        measured, sigma = motion.velocity, np.full(motion.time.size, motion.noise)
        residual[inside] = measured[inside] - path.velocity(motion.time[inside])
    return MotionShown(
        measured_time=motion.time,
        measured=measured,
        sigma=sigma,
        is_velocity=not isinstance(motion, FlyerMotion),
        time=grid,
        position=path.position(grid),
        velocity=path.velocity(grid),
        velocity_sigma=path.sigma_velocity(grid),
        residual=residual,
    )


def surface_of(source: Source, folder: Path) -> dict[str, Any]:
    """The numbers of the stereo result, for a shot measured from its pictures."""
    toml = shot_toml(source)
    declared = toml.declared
    from_files = declared.surface is not None or (
        declared.flyer is not None and declared.centre_line is not None
    )
    if from_files:
        return {}
    from kolsky.pictures.dic_file import read_stereo_result
    from kolsky.pictures.summary import numbers, printed
    from kolsky.shot.optical_data import RESULT_FILE

    result = read_stereo_result(folder / RESULT_FILE)
    page = DIC_PAGE if (folder / DIC_PAGE).is_file() else ""
    return {
        "surface": printed(result),
        "surface_file": RESULT_FILE,
        "surface_page": page,
        "numbers": numbers(result),
        "pair": picture_pair(toml, result),
    }
