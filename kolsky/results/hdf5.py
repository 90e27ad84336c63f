"""A result to its HDF5 file and back: one file a shot, written whole or not at all, read without trust."""

from dataclasses import replace
from pathlib import Path

from kolsky.base.hdf5 import reading, writing
from kolsky.base.json_types import jsonable
from kolsky.inverse.result import Identification
from kolsky.results.layout import FORMAT, IDENTIFICATION


def write_identification(path: Path, identification: Identification) -> None:
    """Write everything `kolsky identify` returns to one HDF5 file, atomically.

    Parameters
    ----------
    path : Path
        The file, replaced if it exists; its folder must exist.
    identification : Identification
        The result. Provenance is stored as JSON: tuples become lists, values that are not finite null.

    Raises
    ------
    ValueError
        If shapes of the result disagree with each other, or a text cannot be stored.
    TypeError
        If provenance holds something JSON cannot say.
    OSError
        If the file cannot be written; an older file of the name is then unchanged.
    """
    plain = replace(identification, provenance=jsonable(identification.provenance, "provenance"))
    with writing(path, FORMAT) as place:
        IDENTIFICATION.write(place, plain)


def read_identification(path: Path) -> Identification:
    """Read a file of `write_identification`, trusting nothing in it.

    Parameters
    ----------
    path : Path
        The HDF5 file, of version 1, 2 or 3.

    Returns
    -------
    Identification
        The same numbers, bit for bit.

    Raises
    ------
    InputError
        If the file is missing, truncated or no such result, or if a dataset is missing, a link to another
        file, of another type, shape or unit, or larger than 1 GiB. The message is one line.
    """
    with reading(Path(path), FORMAT, cure="write it again with `kolsky identify`") as place:
        return IDENTIFICATION.read(place)
