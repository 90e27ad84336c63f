"""MATLAB .mat: plain numeric arrays of versions 5 to 7, and of 7.3 (an HDF5 file).

Objects, functions, cells and structures are not opened: save the signals as plain arrays. The scalars of
PicoScope and of most scripts give the clock: Tinterval and Tstart, dt and t0, fs.

Versions 5 to 7 are read here, after "MAT-File Format", The MathWorks, chapter 1, every count checked
against the bytes that are there. `scipy.io.whosmat` and `loadmat` (SciPy 1.17.1) follow damaged types and
counts out of their buffers: of files with three random bytes changed, each of six series of at most 400
ended the process by a segmentation fault or a bus error, which no check before the call can foresee. A file
of a stranger must not do that.
"""

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.base.errors import InputError
from kolsky.readers.contents import Contents, Layout, file_hash, head_of
from kolsky.readers.hdf5 import NamedArray, array_channels, column_of, columns_of, inside

BINARY = True

UNPACKED_LIMIT = 400_000_000
"""Largest file before 7.3, and largest size of all its variables unpacked [bytes]."""
_HEADER = 128
_MATRIX, _COMPRESSED = 14, 15
_NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
"""Type of a data element -> NumPy's; types 8, 10 and 11 are reserved."""
_CLASSES = {
    1: "cell", 2: "struct", 3: "object", 4: "char", 5: "sparse", 6: "f8", 7: "f4", 8: "i1", 9: "u1",
    10: "i2", 11: "u2", 12: "i4", 13: "u4", 14: "i8", 15: "u8", 16: "function", 17: "opaque",
}  # fmt: skip
"""Class of an array; from 6 to 15 it is one of numbers."""
_COMPLEX = 0x0800


class DamagedError(ValueError):
    """The bytes are no such file."""


@dataclass(frozen=True)
class Variable:
    """A variable of a file."""

    name: str
    """Its name."""
    kind: str
    """Its class; "number" of the arrays that are read."""
    values: np.ndarray | None
    """Its numbers in MATLAB's shape; None for other classes."""


def variables(data: bytes, limit: int) -> Iterator[Variable]:
    """The variables of a file.

    ``data``: the whole file. ``limit``: most bytes that all its elements together may unpack to. Raises
    DamagedError if a count leads out of the file, a type is unknown, or its elements unpack to more than
    `limit`.
    """
    if len(data) < _HEADER or data[126:128] not in (b"IM", b"MI"):
        raise DamagedError("the header is no MATLAB header")
    order = "<" if data[126:128] == b"IM" else ">"
    place, left = _HEADER, limit
    whole = memoryview(data)  # no copies of parts that may be large
    while place + 8 <= len(data):
        kind, count = struct.unpack_from(order + "II", data, place)
        body = whole[place + 8 : place + 8 + count]
        if len(body) < count:
            raise DamagedError(f"an element of {count} bytes at byte {place} is cut off")
        place += 8 + count
        if kind == _COMPRESSED:
            kind, body = _unpacked(body, order, left)
        if kind != _MATRIX:
            raise DamagedError(f"an element of type {kind} where a matrix must be")
        made = _variable(body, order, left)
        left -= max(len(body), 0 if made.values is None else made.values.nbytes)
        if left < 0:
            raise DamagedError(f"its variables unpack to more than {limit / 1e6:.0f} MB")
        yield made
    if place < len(data):
        raise DamagedError("the last element is cut off")


def _unpacked(body: memoryview, order: str, limit: int) -> tuple[int, memoryview]:
    """Type and bytes of a compressed element."""
    inflate = zlib.decompressobj()
    try:
        plain = memoryview(inflate.decompress(body, max(limit, 1)))  # 0 would be no limit
    except zlib.error as error:
        raise DamagedError(f"a compressed element is damaged ({error})") from None
    if inflate.unconsumed_tail:
        raise DamagedError(f"a compressed element unpacks to more than {limit / 1e6:.0f} MB")
    if len(plain) < 8 or not inflate.eof:
        raise DamagedError("a compressed element is cut off")
    kind, count = struct.unpack_from(order + "II", plain)
    if len(plain) - 8 < count:
        raise DamagedError("a compressed element is shorter than it says")
    return kind, plain[8 : 8 + count]


def _variable(body: memoryview, order: str, limit: int) -> Variable:
    """One matrix element: flags, dimensions, name, numbers."""
    elements = _elements(body, order)
    try:
        _, flags = next(elements)
        if len(flags) < 8:
            raise DamagedError("a variable has no class")
        (word,) = struct.unpack_from(order + "I", flags)
        kind = _CLASSES.get(word & 0xFF, "unknown")
        if kind == "opaque":  # a MATLAB object: no dimensions follow
            return Variable("", "object", None)
        _, dimensions = next(elements)
        _, name = next(elements)
        text = bytes(name).decode("latin-1")
        if kind not in _NUMBERS.values():
            return Variable(text, kind, None)
        if word & _COMPLEX:
            return Variable(text, "complex", None)
        stored, numbers = next(elements)
    except StopIteration:
        raise DamagedError("a variable is cut off") from None
    if stored not in _NUMBERS or len(dimensions) % 4:
        raise DamagedError(f"variable '{text}' holds data of type {stored}")
    shape = tuple(int(n) for n in np.frombuffer(dimensions, dtype=order + "i4"))
    kept = np.dtype(order + _NUMBERS[stored])
    size = 1
    for n in shape:
        size *= n
    if min(shape, default=-1) < 0 or size * kept.itemsize != len(numbers):
        raise DamagedError(f"variable '{text}' of shape {shape} has {len(numbers)} bytes")
    if size * np.dtype(kind).itemsize > limit:
        raise DamagedError(f"variable '{text}' of shape {shape} is larger than the {limit / 1e6:.0f} MB left")
    values = np.frombuffer(numbers, dtype=kept).astype(kind).reshape(shape, order="F")
    return Variable(text, "number", values)


def _elements(body: memoryview, order: str) -> Iterator[tuple[int, memoryview]]:
    """Type and bytes of the elements inside a matrix."""
    place = 0
    while place + 8 <= len(body):
        kind, count = struct.unpack_from(order + "II", body, place)
        if kind >> 16:  # up to four bytes lie in the tag itself
            kind, count, start = kind & 0xFFFF, kind >> 16, place + 4
            if count > 4:
                raise DamagedError(f"a small element of {count} bytes")
            end = place + 8
        else:
            start, end = place + 8, place + 8 + count + (-count) % 8
        if start + count > len(body):
            raise DamagedError(f"an element of {count} bytes is cut off")
        yield kind, body[start : start + count]
        place = end


_HDF5_OFFSET = 512
"""A 7.3 file has its HDF5 signature behind a header of text."""


def sniff(path: Path) -> bool:
    """True if a file says it is MATLAB's, or ends in .mat."""
    return head_of(path, 10).startswith(b"MATLAB") or path.suffix.lower() == ".mat"


def read(path: Path, layout: Layout) -> Contents:
    """Read the numeric arrays of a file.

    Raises
    ------
    InputError
        If it is no .mat file or damaged, or holds nothing but objects, cells or structures.
    """
    sha256 = file_hash(path)
    head = head_of(path, _HDF5_OFFSET + 8)
    if head[_HDF5_OFFSET:].startswith(b"\x89HDF") or head.startswith(b"\x89HDF"):
        arrays, scalars, _ = inside(path)
        arrays = [
            NamedArray(a.name.removeprefix("/"), a.samples, a.values, a.unit, a.keys)
            for a in arrays
            if a.name.count("/") == 1
        ]
        scalars = {name.removeprefix("/"): value for name, value in scalars.items()}
        others: list[str] = []
        version = "7.3"
    else:
        file_hash(path, limit=UNPACKED_LIMIT)
        arrays, scalars, others = _plain(path)
        version = "5 to 7"
    if not arrays:
        raise InputError(
            path,
            "holds no numeric array" + (f", but {', '.join(others[:8])}" if others else ""),
            cure="save the signals as plain arrays: save('shot.mat', 'time', 'ch1', 'ch2')",
        )
    return Contents(
        path=path,
        sha256=sha256,
        channels=array_channels(path, arrays, scalars, layout),
        facts={
            "format": "matlab",
            "version": version,
            **({"not opened": ", ".join(others)} if others else {}),
        },
        metadata={name: f"{value:.12g}" for name, value in scalars.items()},
    )


def _plain(path: Path) -> tuple[list[NamedArray], dict[str, float], list[str]]:
    """Arrays, scalars, and what is neither with its class, of a file before 7.3."""
    arrays, scalars, others = [], {}, []
    try:
        found = list(variables(path.read_bytes(), UNPACKED_LIMIT))
    except DamagedError as error:
        raise InputError(
            path, f"is not a .mat file that can be read ({error})", cure="copy it again; it may be cut off"
        ) from None
    for variable in found:
        name, array = variable.name, variable.values
        if array is None or not name:  # without a name: MATLAB's own, beside objects and functions
            others.extend([f"{name} ({variable.kind})"] if name else [])
        elif array.size == 1:
            scalars[name] = float(array.ravel()[0])
        else:
            for column_name, samples, column in columns_of(name, array.shape):

                def values(array: np.ndarray = array, column: int | None = column) -> FloatArray:
                    return column_of(array, column)

                arrays.append(NamedArray(column_name, samples, values))
    return arrays, scalars, others
