"""Exports of DIC programs: points of a surface, one text file a frame."""

from kolsky.readers.dic_export.export import DicExport, PointState, matching, read
from kolsky.readers.dic_export.layouts import LAYOUTS, ExportLayout

__all__ = ["LAYOUTS", "DicExport", "ExportLayout", "PointState", "matching", "read"]
