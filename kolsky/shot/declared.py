"""The files that shot.toml declares, read and checked: the flyer's motion, the force, the outline."""

from math import inf
from pathlib import Path

import numpy as np

from kolsky.base.apparatus import Transducer
from kolsky.base.errors import refuse
from kolsky.base.records import CentreLine, FlyerMotion
from kolsky.readers import centre_line_csv, flyer_csv
from kolsky.readers.frame_times import FrameTimes
from kolsky.readers.table import Column
from kolsky.shot import force_checks, frame_checks
from kolsky.shot.force import force_recording
from kolsky.shot.records import ForceChannel
from kolsky.shot.schema.measured import CentreLineSection, FlyerSection
from kolsky.shot.schema.reading import ShotToml


def flyer_motion(
    folder: Path, frames: FrameTimes, section: FlyerSection, toml: ShotToml
) -> tuple[FlyerMotion, str]:
    """[flyer]: the flyer's displacement at the frames, toward the specimen, and the hash of its file.

    Raises
    ------
    InputError
        If the file cannot be read, its frames and times are not those of [frames], or the flyer rests.
    """
    table = flyer_csv.read(
        folder / section.file,
        frame=Column(section.frame),
        displacement=section.displacement.as_column(),
        time=None if section.time is None else section.time.as_column(),
    )
    frame_checks.frames_agree(table, frames)
    frame_checks.flyer_covers(table, frames, toml)
    sign = 1.0 if section.positive == "toward specimen" else -1.0
    index = np.searchsorted(frames.frame, table.frame)
    flyer = FlyerMotion(
        time=frames.time[index] + toml.declared.frames.clock_offset,
        displacement=sign * table.displacement,
        sigma=np.full(table.displacement.size, section.sigma),
    )
    frame_checks.flyer_moves(table, flyer, section.sigma, toml)
    return flyer, table.sha256


def force_channel(folder: Path, rest: float, toml: ShotToml) -> ForceChannel:
    """[force]: the recorder's channel with its transducer; `rest` is the last frame before the test [s].

    Raises
    ------
    InputError
        If the file cannot be read, or the channel is clipped, or its baseline does not lie before the test.
    """
    section = toml.declared.force
    recording = force_recording(folder / section.file, section)
    force_checks.clipping(recording, toml)
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
    force_checks.baseline(channel.baseline_volts(), rest, toml)
    return channel


def outline(
    folder: Path, frames: FrameTimes, section: CentreLineSection, toml: ShotToml
) -> tuple[CentreLine, str]:
    """[centre_line]: the specimen's outline at the frames, and the hash of its file.

    Raises
    ------
    InputError
        If the file cannot be read, or its frames and times are not those of [frames].
    """
    table = centre_line_csv.read(
        folder / section.file,
        frame=Column(section.frame),
        y=section.y.as_column(),
        Z=section.Z.as_column(),
        sigma=None if section.sigma_column is None else section.sigma_column.as_column(),
        time=None if section.time is None else section.time.as_column(),
    )
    frame_checks.frames_agree(table, frames)
    index = np.searchsorted(frames.frame, table.frame)
    line = CentreLine(
        time=frames.time[index] + toml.declared.frames.clock_offset,
        frame=table.frame,
        y=table.y + section.y_offset,
        Z=table.Z + section.Z_offset,
        sigma=np.full(table.Z.size, section.sigma) if table.sigma is None else table.sigma,
    )
    return line, table.sha256


def all_there(toml: ShotToml, folder: Path) -> None:
    """See that every declared file is there.

    Raises
    ------
    InputError
        If any is missing; all of them are named.
    """
    missing = {key: name for key, name in toml.declared.data_files().items() if not (folder / name).exists()}
    refuse(
        [
            toml.error(key, f"names a missing file: {folder / name}", cure="put it there or correct its name")
            for key, name in missing.items()
        ]
    )
