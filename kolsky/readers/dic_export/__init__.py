"""Exports of DIC programs: points of a surface, one text file a frame."""

from kolsky.readers.dic_export.layouts import LAYOUTS, ExportLayout
from kolsky.readers.dic_export.read import DicExport, PointState, matching, read

__all__ = ["LAYOUTS", "DicExport", "ExportLayout", "PointState", "matching", "read"]
