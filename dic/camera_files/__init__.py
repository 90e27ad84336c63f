"""Calibrations of other programs: the registry of formats, and the functions that read and write a rig.

To add a format, write its module and add one line to `FORMATS`.
"""

from pathlib import Path
from typing import Protocol

from dic.camera import StereoRig
from dic.camera_files.dice import DiceText, DiceXml
from dic.camera_files.matchid import MatchID
from dic.camera_files.opencorr import OpenCorr
from dic.camera_files.opencv import OpenCV
from dic.camera_files.source import CameraFileError, Source
from dic.camera_files.vic3d import Vic3D


class CameraFormat(Protocol):
    """Protocol of camera file formats."""

    name: str
    """Name of the format, for `write_rig`."""
    about: str
    """Program and kind of file, for messages."""
    suffix: str
    """Usual ending of a file's name."""
    absolute_pose: bool
    """True if a file stores the poses of both cameras; False if it stores only their relative pose."""
    tangential: bool
    """True if a file stores tangential distortion; if False, `write` rejects a rig with it."""

    def sniff(self, text: str) -> bool:
        """True if a file's text is of this format."""

    def read(self, source: Source, length_unit: float) -> StereoRig:
        """The rig of a file whose lengths are multiples of `length_unit` [m], unless the file states its
        unit.

        Raises CameraFileError if the text is not valid in this format.
        """

    def write(self, rig: StereoRig, length_unit: float) -> str:
        """The text of a file with lengths in multiples of `length_unit` [m].

        Raises ValueError if the format cannot store the rig.
        """


FORMATS: tuple[CameraFormat, ...] = (Vic3D(), DiceXml(), MatchID(), OpenCorr(), OpenCV(), DiceText())
"""All formats, in the order in which they are tried."""


def read_rig(path: Path | str, *, length_unit: float = 1e-3) -> StereoRig:
    """Two calibrated cameras from the file of any known program.

    Parameters
    ----------
    path
        A VIC-3D project, a DICe camera system (XML or text), a MatchID .caldat, an OpenCV storage file or
        OpenCorr's camera parameters. The format is recognised by the content.
    length_unit
        The file's unit of length [m], that of the calibration target. If a file states its unit, that one is
        used.

    Returns
    -------
    StereoRig
        The rig for pictures of the whole sensor, as calibrated; `StereoRig.cropped` adapts it to a crop. It
        has a covariance only if the file contains one.

    Raises
    ------
    CameraFileError
        If the file cannot be read, has no known format, or does not contain two cameras.
    """
    if not 0.0 < length_unit <= 1.0:
        raise ValueError(f"length_unit must be above 0 and at most 1 m, got {length_unit}")
    source = Source.open(path)
    for format_ in FORMATS:
        if format_.sniff(source.text):
            return format_.read(source, length_unit)
    formats = ", ".join(format_.about for format_ in FORMATS)
    raise CameraFileError(path, "is no camera file known here", cure=f"known are: {formats}")


def write_rig(path: Path | str, rig: StereoRig, format: str, *, length_unit: float = 1e-3) -> None:
    """Write a rig for another program.

    Parameters
    ----------
    path
        The file; an existing file is replaced.
    rig
        The cameras.
    format
        The name of a member of `FORMATS`. Only "opencv" stores the covariance; formats without
        `CameraFormat.absolute_pose` store the relative pose only.
    length_unit
        Unit of the file's lengths [m].

    Raises
    ------
    CameraFileError
        If the format is unknown or cannot store this rig.
    """
    by_name = {file_format.name: file_format for file_format in FORMATS}
    if format not in by_name:
        raise CameraFileError(path, f"format {format!r} is unknown", cure=f"use one of {', '.join(by_name)}")
    if not 0.0 < length_unit <= 1.0:
        raise ValueError(f"length_unit must be above 0 and at most 1 m, got {length_unit}")
    try:
        text = by_name[format].write(rig, length_unit)
    except ValueError as error:
        raise CameraFileError(path, str(error), cure="choose another format") from None
    Path(path).write_text(text, encoding="utf-8")


__all__ = ["FORMATS", "CameraFileError", "CameraFormat", "read_rig", "write_rig"]
