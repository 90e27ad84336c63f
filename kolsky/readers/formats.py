"""The formats of recorders' files, in the order in which a file is tried."""

from collections.abc import Mapping
from pathlib import Path
from typing import Protocol

from kolsky.readers import (
    delimited,
    excel,
    excel_97,
    hdf5,
    labview_lvm,
    lanl_raw,
    matlab,
    scope_binary,
    tdms,
    tektronix_csv,
)
from kolsky.readers.contents import Contents, Layout


class RecorderFormat(Protocol):
    """The functions of a module that reads one format."""

    BINARY: bool
    """Whether its files are no text: they have no lines to name and no digits that were printed."""

    def sniff(self, path: Path) -> bool:
        """True if a file looks like this format, by its ending and first bytes."""

    def read(self, path: Path, layout: Layout) -> Contents:
        """Its channels; raises `InputError`."""


FORMATS: Mapping[str, RecorderFormat] = {
    "excel": excel,
    "excel 97": excel_97,
    "tdms": tdms,
    "matlab": matlab,
    "hdf5": hdf5,
    "lvm": labview_lvm,
    "tektronix": tektronix_csv,
    "lanl": lanl_raw,
    "scope": scope_binary,
    "delimited": delimited,
}
"""Name -> module, one file and one line here for each; text of any make comes last."""
