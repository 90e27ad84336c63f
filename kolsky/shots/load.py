"""A shot: one test, its apparatus and its measurements, loaded from a folder and checked."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from math import inf
from pathlib import Path
from typing import Any

import numpy as np

from kolsky.apparatus import Bar, Interface, Specimen, Transducer
from kolsky.errors import InputError, refuse
from kolsky.notebook import ShotInNotebook
from kolsky.readers import centre_line_csv, flyer_csv, frame_times
from kolsky.readers.frame_times import FrameTimes
from kolsky.readers.table import Column
from kolsky.records import (
    CentreLine,
    FloatArray,
    FlyerMotion,
    ForceHistory,
    FrontVelocity,
    MaterialCurve,
    Recording,
)
from kolsky.shotfiles.bars import AnyFile
from kolsky.shotfiles.reading import ShotToml, read_declared, read_shot_toml
from kolsky.shotfiles.schema import CentreLineSection, FlyerSection
from kolsky.shots import forcechecks, framechecks, shapechecks
from kolsky.shots.barforce import BarForce
from kolsky.shots.curve import read_curve
from kolsky.shots.force import force_recording
from kolsky.shots.pictures import Seen, open_pictures
from kolsky.shots.window import window
from kolsky.transducers import force_history, noise_correlation

SHOT_FILE = "shot.toml"


@dataclass(frozen=True)
class ModelSettings:
    """Material constants that the quasi-static curve does not give."""

    poisson: float
    """Poisson's ratio of the initial state [-]."""
    damping: float
    """Stiffness-proportional damping beta, Eq. (M.2) [s]."""
    damping_kind: str
    """What beta acts on: "deviatoric" or "full"."""
    mass_damping: float
    """Mass-proportional damping alpha [1/s]."""


@dataclass(frozen=True)
class ForceChannel:
    """The transmitted force as volts of a recorder, with what turns them into newtons."""

    recording: Recording
    """The channel, on the recorder's own clock."""
    transducer: Transducer
    """Sensitivity, sign and full scale."""
    baseline: tuple[float, float]
    """Time span before the test that gives zero and noise, on the shot's clock [s]."""
    clock_offset: float
    """Shot's clock minus recorder's clock [s]."""
    sigma_gain: float = 0.0
    """Standard uncertainty of the sensitivity, relative to it [-]."""

    @property
    def time(self) -> FloatArray:
        """Sample times on the shot's clock [s], shape [n_samples]."""
        return self.recording.time + self.clock_offset

    def baseline_volts(self) -> FloatArray:
        """The samples of the baseline window [V], shape [n]."""
        time = self.time
        return self.recording.value[(time >= self.baseline[0]) & (time <= self.baseline[1])]

    def raw_force(self) -> FloatArray:
        """Force at every sample above the baseline's mean, compression-positive [N], shape [n_samples]."""
        volts = self.recording.value - self.baseline_volts().mean()
        return self.transducer.compression_sign * volts / self.transducer.sensitivity

    def history(self) -> ForceHistory:
        """The force with its noise; see `kolsky.transducers.force_history`.

        Raises
        ------
        ValueError
            If the recording, the baseline or the transducer cannot be used.
        """
        return force_history(
            self.recording, self.transducer, baseline=self.baseline, clock_offset=self.clock_offset
        )

    def noise_checks(self) -> dict[str, float]:
        """Figures that tell whether the noise of the force is believable."""
        return {
            "force_noise_correlation": noise_correlation(self.history(), self.baseline),
            "force_baseline_samples": int(self.baseline_volts().size),
        }


@dataclass(frozen=True, kw_only=True, repr=False)
class ShotBase(ShotInNotebook):
    """What a shot is apart from what its cameras saw (SI, one clock)."""

    name: str
    """Name of the shot; by default its folder's."""
    folder: Path
    """The folder its files are in."""
    specimen: Specimen
    """The specimen before the test."""
    interface: Interface
    """How it holds to the platens."""
    support: str
    """What stands behind it: "rigid" or "bar"."""
    transmission_bar: Bar | None
    """The bar, where support is "bar"."""
    model: ModelSettings
    """Material constants beside the curve."""
    force: ForceChannel | BarForce
    """The transmitted force, of a transducer or of the bar itself."""
    curve: MaterialCurve
    """The quasi-static curve, from rest outward."""
    inputs: dict[str, str]
    """SHA-256 of every file that was read: name in the folder -> hex digest."""
    uncertainty: Mapping[str, float] = field(default_factory=dict)
    """Declared standard uncertainties by their keys, SI or relative; an absent one was not declared."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Shot(ShotBase):
    """One test, ready to be identified."""

    flyer: FlyerMotion | FrontVelocity
    """What moves the front face: the flyer's displacement at the frames, zero as in its file, or the
    velocity of the incident bar's face."""
    centre_line: CentreLine | None
    """The specimen's outline at the frames; None if nobody looked."""
    window: tuple[float, float]
    """First and last time that is simulated and compared, on the shot's clock [s]."""
    symmetry_end: float | None = None
    """Time at which the flyer leaves its first direction, if pictures say so [s]."""


@dataclass(frozen=True, kw_only=True, repr=False)
class PicturedShot(ShotBase):
    """One test whose pictures are still to be correlated."""

    seen: Seen
    """Its pictures and frames."""


@dataclass(frozen=True)
class Measured:
    """What the cameras saw, as numbers."""

    flyer: FlyerMotion
    """The flyer's displacement at the frames."""
    centre_line: CentreLine
    """The specimen's outline at the frames."""
    source: Path
    """The file that a complaint about them names."""
    symmetry_end: float | None = None
    """Time at which the flyer leaves its first direction, on the shot's clock [s]; None if it does not."""


def load_shot(folder_or_toml: str | Path, *, measure: Callable[[Seen], Measured] | None = None) -> Shot:
    """Load and check a shot.

    Parameters
    ----------
    folder_or_toml
        The shot's folder with its shot.toml, or the path of such a file.
    measure
        How pictures become numbers, for a shot without exports; by default `kolsky.measure.measured`,
        which keeps them in the shot's results folder.

    Returns
    -------
    Shot
        Everything declared and measured, in SI, on the shot's clock.

    Raises
    ------
    InputError
        If a file is missing or damaged, a declaration is unknown, incomplete or impossible, or
        declarations and recordings contradict each other.
    """
    if is_bar_driven(folder_or_toml):
        from kolsky.shots.bardriven import load_bar_driven

        return load_bar_driven(folder_or_toml)
    toml, frames = _opened(folder_or_toml)
    declared, folder = toml.declared, toml.path.parent
    frame_time = frames.time + declared.frames.clock_offset
    rest = float(frame_time[declared.frames.static - 1])
    if declared.surface is not None:
        return _with_surface(toml, frames, rest)
    if declared.flyer is None or declared.centre_line is None:
        return _with_pictures(toml, frames, rest, measure)
    flyer, flyer_hash = _flyer(folder, frames, declared.flyer, toml)
    force = _force(folder, rest, toml)
    span = window(toml, frame_time, float(flyer.time[-1]), force.recording, force.time)
    forcechecks.force_sign(force.raw_force(), force.time, span, flyer, toml)
    centre_line, outline_hash = _centre_line(folder, frames, declared.centre_line, toml)
    shapechecks.outline(centre_line, folder / declared.centre_line.file, rest, span, toml)
    curve, curve_hashes = read_curve(folder, declared.baseline)
    exports = {declared.flyer.file: flyer_hash, declared.centre_line.file: outline_hash}
    base = _base(toml, frames, force, curve, curve_hashes, exports)
    return Shot(**base, flyer=flyer, centre_line=centre_line, window=span)


def load_pictures(folder_or_toml: str | Path) -> PicturedShot:
    """Load and check what a shot with pictures has before they are correlated.

    Raises
    ------
    InputError
        As `load_shot`, or if the shot has no pictures.
    """
    toml, frames = _opened(folder_or_toml)
    if toml.declared.pictures is None:
        raise toml.error(
            "pictures", "is missing: this shot has no pictures", cure="add [pictures], [calibration], [dic]"
        )
    return _pictured(toml, frames, open_pictures(toml, frames))


def check_shot(folder_or_toml: str | Path) -> ShotBase:
    """Load a shot as far as it goes without correlating pictures.

    Raises
    ------
    InputError
        As `load_shot`.
    """
    if is_bar_driven(folder_or_toml):
        return load_shot(folder_or_toml)
    toml, _ = _opened(folder_or_toml)
    if toml.declared.flyer is None and toml.declared.surface is None:
        return load_pictures(folder_or_toml)
    if toml.declared.pictures is not None:
        load_pictures(folder_or_toml)
    return load_shot(folder_or_toml)


def _with_surface(toml: ShotToml, frames: FrameTimes, rest: float) -> Shot:
    """A shot whose outline, and perhaps flyer, come from exports of a whole surface."""
    from kolsky.shots.surface import measured_surface

    declared, folder = toml.declared, toml.path.parent
    assert declared.surface is not None  # the caller saw to it
    centre_line, flyer, inputs = measured_surface(toml, declared.surface, frames)
    source = folder / declared.surface.pattern
    if flyer is None:
        assert declared.flyer is not None  # the schema saw to it
        flyer, inputs[declared.flyer.file] = _flyer(folder, frames, declared.flyer, toml)
    else:
        framechecks.body_moves(flyer, rest, source, toml)
    force = _force(folder, rest, toml)
    frame_time = frames.time + declared.frames.clock_offset
    span = window(toml, frame_time, float(flyer.time[-1]), force.recording, force.time)
    forcechecks.force_sign(force.raw_force(), force.time, span, flyer, toml)
    shapechecks.outline(centre_line, source, rest, span, toml)
    curve, curve_hashes = read_curve(folder, declared.baseline)
    base = _base(toml, frames, force, curve, curve_hashes, inputs)
    return Shot(**base, flyer=flyer, centre_line=centre_line, window=span)


def _with_pictures(
    toml: ShotToml, frames: FrameTimes, rest: float, measure: Callable[[Seen], Measured] | None
) -> Shot:
    """A shot whose flyer and outline come from its pictures."""
    shot = _pictured(toml, frames, open_pictures(toml, frames))
    if measure is None:
        from kolsky.measure import measured

        measure = measured
    found = measure(shot.seen)
    assert isinstance(shot.force, ForceChannel)  # `_pictured` made it so
    frame_time = frames.time + toml.declared.frames.clock_offset
    framechecks.body_moves(found.flyer, rest, found.source, toml)
    span = window(
        toml,
        frame_time,
        float(found.flyer.time[-1]),
        shot.force.recording,
        shot.force.time,
        symmetry_end=found.symmetry_end,
    )
    forcechecks.force_sign(shot.force.raw_force(), shot.force.time, span, found.flyer, toml)
    shapechecks.outline(found.centre_line, found.source, rest, span, toml)
    base = {field.name: getattr(shot, field.name) for field in fields(ShotBase)}
    return Shot(
        **base,
        flyer=found.flyer,
        centre_line=found.centre_line,
        window=span,
        symmetry_end=found.symmetry_end,
    )


def _pictured(toml: ShotToml, frames: FrameTimes, seen: Seen) -> PicturedShot:
    folder, declared = toml.path.parent, toml.declared
    rest = float(frames.time[declared.frames.static - 1] + declared.frames.clock_offset)
    force = _force(folder, rest, toml)
    curve, curve_hashes = read_curve(folder, declared.baseline)
    return PicturedShot(**_base(toml, frames, force, curve, curve_hashes, seen.inputs), seen=seen)


def _opened(folder_or_toml: str | Path) -> tuple[ShotToml, FrameTimes]:
    """The shot file and the frame times."""
    toml = read_shot_toml(find_shot_file(Path(folder_or_toml)))
    declared, folder = toml.declared, toml.path.parent
    _all_there(toml, folder)
    frames = frame_times.read(
        folder / declared.frames.file,
        frame=Column(declared.frames.frame),
        time=declared.frames.time.as_column(),
    )
    framechecks.some_motion_frames(frames, toml)
    return toml, frames


def _base(
    toml: ShotToml,
    frames: FrameTimes,
    force: ForceChannel,
    curve: MaterialCurve,
    curve_hashes: dict[str, str],
    optical: dict[str, str],
) -> dict[str, Any]:
    """The fields of `ShotBase`; `optical` are the hashes of what tells what the cameras saw."""
    declared, folder = toml.declared, toml.path.parent
    specimen, interface, bar = declared.specimen, declared.interface, declared.transmission.bar
    return {
        "name": declared.name or folder.resolve().name,
        "folder": folder,
        "specimen": Specimen(diameter=specimen.diameter, length=specimen.length, density=specimen.density),
        "interface": Interface(
            faces=interface.faces,
            side=interface.side,
            friction=interface.friction or 0.0,
            release_stress=interface.release_stress or 0.0,
        ),
        "support": declared.transmission.support,
        "transmission_bar": None if bar is None else Bar(**bar.model_dump()),
        "model": ModelSettings(**declared.model.model_dump()),
        "force": force,
        "curve": curve,
        "uncertainty": {} if declared.uncertainty is None else declared.uncertainty.for_identify(),
        "inputs": {
            toml.path.name: toml.sha256,
            declared.force.file: force.recording.sha256,
            declared.frames.file: frames.sha256,
            **optical,
            **curve_hashes,
        },
    }


def is_bar_driven(folder_or_toml: str | Path) -> bool:
    """Whether a shot's motion and force come from the gauges of its bars: [gauges] and no cameras.

    Raises
    ------
    InputError
        If the file cannot be read or is no TOML.
    """
    content = read_declared(find_shot_file(Path(folder_or_toml)), lambda content: AnyFile)[0].content
    return "gauges" in content and not {"flyer", "pictures", "frames"} & set(content)


def folder_of(folder_or_toml: str | Path) -> Path:
    """The folder of a shot that is named by its folder or its shot file."""
    path = Path(folder_or_toml)
    return path.parent if path.is_file() else path


def find_shot_file(path: Path) -> Path:
    """The shot file of a folder, or the file itself."""
    if path.is_dir():
        if not (path / SHOT_FILE).exists():
            raise InputError(path, f"has no {SHOT_FILE}", cure=f"`kolsky new {path}` writes one to fill in")
        return path / SHOT_FILE
    if not path.exists():
        raise InputError(path, "there is no such folder or file", cure="give the folder of a shot")
    return path


def _all_there(toml: ShotToml, folder: Path) -> None:
    """Report all missing files at once."""
    missing = {key: name for key, name in toml.declared.data_files().items() if not (folder / name).exists()}
    refuse(
        [
            toml.error(key, f"names a missing file: {folder / name}", cure="put it there or correct its name")
            for key, name in missing.items()
        ]
    )


def _flyer(
    folder: Path, frames: FrameTimes, section: FlyerSection, toml: ShotToml
) -> tuple[FlyerMotion, str]:
    table = flyer_csv.read(
        folder / section.file,
        frame=Column(section.frame),
        displacement=section.displacement.as_column(),
        time=None if section.time is None else section.time.as_column(),
    )
    framechecks.frames_agree(table, frames)
    framechecks.flyer_covers(table, frames, toml)
    sign = 1.0 if section.positive == "toward specimen" else -1.0
    index = np.searchsorted(frames.frame, table.frame)
    flyer = FlyerMotion(
        time=frames.time[index] + toml.declared.frames.clock_offset,
        displacement=sign * table.displacement,
        sigma=np.full(table.displacement.size, section.sigma),
    )
    framechecks.flyer_moves(table, flyer, section.sigma, toml)
    return flyer, table.sha256


def _force(folder: Path, rest: float, toml: ShotToml) -> ForceChannel:
    section = toml.declared.force
    recording = force_recording(folder / section.file, section)
    forcechecks.clipping(recording, toml)
    channel = ForceChannel(
        recording=recording,
        transducer=Transducer(
            sensitivity=section.sensitivity,
            compression_sign=1 if section.compression == "positive" else -1,
            full_scale=section.full_scale,
            time_constant=inf if section.time_constant is None else section.time_constant,
        ),
        baseline=section.baseline,
        clock_offset=section.clock_offset,
    )
    forcechecks.baseline(channel.baseline_volts(), rest, toml)
    return channel


def _centre_line(
    folder: Path, frames: FrameTimes, section: CentreLineSection, toml: ShotToml
) -> tuple[CentreLine, str]:
    table = centre_line_csv.read(
        folder / section.file,
        frame=Column(section.frame),
        y=section.y.as_column(),
        Z=section.Z.as_column(),
        sigma=None if section.sigma_column is None else section.sigma_column.as_column(),
        time=None if section.time is None else section.time.as_column(),
    )
    framechecks.frames_agree(table, frames)
    index = np.searchsorted(frames.frame, table.frame)
    line = CentreLine(
        time=frames.time[index] + toml.declared.frames.clock_offset,
        frame=table.frame,
        y=table.y + section.y_offset,
        Z=table.Z + section.Z_offset,
        sigma=np.full(table.Z.size, section.sigma) if table.sigma is None else table.sigma,
    )
    return line, table.sha256
