"""What was measured, in the summary of a shot: window, pictures, force, motion of the front face, outline."""

import numpy as np

from kolsky.bars.flyer.front_path import BarForce
from kolsky.base.records import CentreLine, FlyerMotion
from kolsky.shot.picture_set import CAMERAS, readable
from kolsky.shot.records import PicturedShot, Shot, ShotBase
from kolsky.shot.summary_entry import Entry


def _inside(shot: Shot, time: np.ndarray) -> np.ndarray:
    return (time >= shot.window[0]) & (time <= shot.window[1])


def window_entries(shot: Shot) -> list[Entry]:
    """The window, and how many samples of the front face lie in it."""
    (start, end), time = shot.window, shot.flyer.time
    what = "frames" if isinstance(shot.flyer, FlyerMotion) else "samples"
    return [
        Entry("window", "start", start, "s"),
        Entry("window", "end", end, "s"),
        Entry("window", f"{what} inside", int(_inside(shot, time).sum())),
        Entry("window", f"{what} before it", int((time < start).sum())),
        Entry("window", f"{what} after it", int((time > end).sum())),
    ]


def picture_entries(shot: PicturedShot) -> list[Entry]:
    """The pictures of both cameras, and how they are correlated."""
    declared = shot.pictures.toml.declared
    assert declared.pictures is not None  # else there is no such shot
    assert declared.calibration is not None
    assert declared.dic is not None
    rows = [
        Entry("frames", "frames", shot.pictures.time.size),
        Entry("frames", "static", declared.frames.static),
    ]
    for name, section, series in zip(CAMERAS, declared.pictures.cameras, shot.pictures.series, strict=True):
        height, width = series.shape
        x, y = series.crop_offset
        rows += [
            Entry("pictures", f"{name}, files", section.source[1]),
            Entry("pictures", f"{name}, size", f"{width} x {height} px at ({x:g}, {y:g}) of the sensor"),
            Entry("pictures", f"{name}, bits", series.bits),
        ]
        missing = shot.pictures.time.size - readable(series)
        if missing:
            rows.append(Entry("pictures", f"{name}, pictures cut off", missing))
    calibration, dic = declared.calibration, declared.dic
    source = calibration.file or f"pictures of a target: {calibration.camera_0}, {calibration.camera_1}"
    return [
        *rows,
        Entry("calibration", "from", source),
        Entry("dic", "subset", f"{dic.subset} px, {dic.shape}"),
        Entry("dic", "step", f"{dic.step} px"),
        Entry("dic", "flyer_side", dic.flyer_side),
        Entry("dic", "strip_half_width", dic.strip_half_width, "m"),
    ]


def force_entries(shot: ShotBase) -> list[Entry]:
    """The force: its record, its noise, its largest values."""
    channel = shot.force
    if isinstance(channel, BarForce):
        force = channel.raw_force()
        return [
            Entry("force", "from", "waves in the transmission bar"),
            Entry("force", "samples", int(force.size)),
            Entry("force", "record start", float(channel.time[0]), "s"),
            Entry("force", "record end", float(channel.time[-1]), "s"),
            Entry("force", "noise of the force", float(np.median(channel.measured.sigma)), "N"),
            Entry("force", "sigma of its scale", channel.sigma_gain),
            Entry("force", "largest compression", float(force.max()), "N"),
            Entry("force", "largest tension", float(-force.min()), "N"),
        ]
    time, volts, zero = channel.time, channel.recording.value, channel.baseline_volts()
    noise = float(zero.std(ddof=1))
    return [
        Entry("force", "channel", channel.recording.channel),
        Entry("force", "samples", int(volts.size)),
        Entry("force", "sample step", float(np.median(np.diff(time))), "s"),
        Entry("force", "record start", float(time[0]), "s"),
        Entry("force", "record end", float(time[-1]), "s"),
        Entry("force", "sensitivity", channel.transducer.sensitivity, "V/N"),
        Entry("force", "compression", "positive" if channel.transducer.compression_sign > 0 else "negative"),
        Entry("force", "full_scale", channel.transducer.full_scale, "V"),
        Entry("force", "largest voltage", float(np.abs(volts).max()), "V"),
        Entry("force", "baseline start", channel.baseline[0], "s"),
        Entry("force", "baseline end", channel.baseline[1], "s"),
        Entry("force", "baseline samples", int(zero.size)),
        Entry("force", "baseline zero", float(zero.mean()), "V"),
        Entry("force", "baseline noise", noise, "V"),
        Entry("force", "noise of the force", noise / channel.transducer.sensitivity, "N"),
        Entry("force", "largest compression", float(channel.raw_force().max()), "N"),
        Entry("force", "largest tension", float(-channel.raw_force().min()), "N"),
    ]


def motion_entries(shot: Shot) -> list[Entry]:
    """The motion of the front face, from pictures or from waves."""
    motion = shot.flyer
    if isinstance(motion, FlyerMotion):
        return _flyer(motion, shot)
    return [
        Entry("motion", "from", "waves in the incident bar"),
        Entry("motion", "samples", int(motion.time.size)),
        Entry("motion", "sample step", float(np.median(np.diff(motion.time))), "s"),
        Entry("motion", "largest velocity", float(motion.velocity.max()), "m/s"),
        Entry("motion", "noise of the velocity", motion.noise, "m/s"),
        Entry("motion", "sigma of its scale", motion.sigma_gain),
        Entry("motion", "sigma of its zero", motion.sigma_zero, "m/s"),
    ]


def _flyer(flyer: FlyerMotion, shot: Shot) -> list[Entry]:
    rest = flyer.displacement[flyer.time <= shot.window[0]]
    scatter = [Entry("flyer", "scatter at rest", float(rest.std(ddof=1)), "m")] if rest.size > 1 else []
    return [
        Entry("flyer", "frames", int(flyer.time.size)),
        Entry("flyer", "first frame", float(flyer.time[0]), "s"),
        Entry("flyer", "last frame", float(flyer.time[-1]), "s"),
        Entry(
            "flyer", "travel in the window", float(np.ptp(flyer.displacement[_inside(shot, flyer.time)])), "m"
        ),
        Entry("flyer", "sigma", float(flyer.sigma.max()), "m"),
        *scatter,
    ]


def centre_line_entries(line: CentreLine, shot: Shot) -> list[Entry]:
    """The outline: its points, and the frames that have some."""
    inside = _inside(shot, line.time)
    _, counts = np.unique(line.frame[inside], return_counts=True)
    return [
        Entry("centre_line", "points", int(line.Z.size)),
        Entry("centre_line", "points in the window", int(inside.sum())),
        Entry("centre_line", "frames with points in the window", int(counts.size)),
        Entry("centre_line", "fewest points in a frame", int(counts.min())),
        Entry("centre_line", "most points in a frame", int(counts.max())),
        Entry("centre_line", "smallest y", float(line.y.min()), "m"),
        Entry("centre_line", "largest y", float(line.y.max()), "m"),
        Entry("centre_line", "smallest Z", float(line.Z.min()), "m"),
        Entry("centre_line", "largest Z", float(line.Z.max()), "m"),
        Entry("centre_line", "smallest sigma", float(line.sigma.min()), "m"),
        Entry("centre_line", "largest sigma", float(line.sigma.max()), "m"),
    ]
