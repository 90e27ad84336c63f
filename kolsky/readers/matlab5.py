"""Numeric arrays of a MATLAB version 5 to 7 file, every count checked against the bytes that are there.

After "MAT-File Format", The MathWorks, chapter 1. SciPy's reader follows damaged types and counts out of its
buffers, which ends the process; a file of a stranger must not.
"""

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

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

    Parameters
    ----------
    data
        The whole file.
    limit
        Most bytes that an element may unpack to.

    Raises
    ------
    DamagedError
        If a count leads out of the file, a type is unknown, or an element unpacks to more than `limit`.
    """
    if len(data) < _HEADER or data[126:128] not in (b"IM", b"MI"):
        raise DamagedError("the header is no MATLAB header")
    order = "<" if data[126:128] == b"IM" else ">"
    place = _HEADER
    while place + 8 <= len(data):
        kind, count = struct.unpack_from(order + "II", data, place)
        body = data[place + 8 : place + 8 + count]
        if len(body) < count:
            raise DamagedError(f"an element of {count} bytes at byte {place} is cut off")
        place += 8 + count
        if kind == _COMPRESSED:
            kind, body = _unpacked(body, order, limit)
        if kind != _MATRIX:
            raise DamagedError(f"an element of type {kind} where a matrix must be")
        yield _variable(body, order)
    if place < len(data):
        raise DamagedError("the last element is cut off")


def _unpacked(body: bytes, order: str, limit: int) -> tuple[int, bytes]:
    """Type and bytes of a compressed element."""
    inflate = zlib.decompressobj()
    try:
        plain = inflate.decompress(body, limit)
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


def _variable(body: bytes, order: str) -> Variable:
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
        text = name.decode("latin-1")
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
    values = np.frombuffer(numbers, dtype=kept).astype(kind).reshape(shape, order="F")
    return Variable(text, "number", values)


def _elements(body: bytes, order: str) -> Iterator[tuple[int, bytes]]:
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
