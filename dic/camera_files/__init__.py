"""Calibrations of other programs: one format a file."""

from dic.camera_files.formats import FORMATS, CameraFormat, read_rig, write_rig
from dic.camera_files.source import CameraFileError

__all__ = ["FORMATS", "CameraFileError", "CameraFormat", "read_rig", "write_rig"]
