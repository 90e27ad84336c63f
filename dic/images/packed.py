"""Grey values of 10 and 12 bits without gaps between them, first bit the most significant.

This is how TIFF (12 bits), Photron's `.mraw` and Phantom's P10 and P12L store them: four values of 10 bits in
five bytes, two of 12 bits in three.
"""

import numpy as np
from numpy.typing import NDArray

Bytes = NDArray[np.uint8]
Words = NDArray[np.uint16]


def packed_size(values: int, bits: int) -> int:
    """Bytes that so many grey values take, the last byte filled up with zeros."""
    return (values * bits + 7) // 8


def unpack(raw: Bytes, bits: int, values: int) -> Words:
    """The first `values` grey values of packed bytes, shape [values].

    Parameters
    ----------
    raw
        The bytes, at least `packed_size` of them, shape [n].
    bits
        Bits of a grey value: 10 or 12.
    values
        How many grey values to read.

    Raises
    ------
    ValueError
        Other bits, or fewer bytes than the values need.
    """
    if bits not in (10, 12):
        raise ValueError(f"bits = {bits}: packed grey values have 10 or 12")
    need = packed_size(values, bits)
    if raw.size < need:
        raise ValueError(f"{values} grey values of {bits} bits need {need} bytes, there are {raw.size}")
    group = 5 if bits == 10 else 3  # bytes, the fewest that hold a whole number of values
    groups = -(-need // group)
    padded = np.zeros(groups * group, dtype=np.uint8)
    padded[:need] = raw[:need]
    byte = padded.reshape(groups, group).astype(np.uint16).T
    if bits == 10:
        a, b, c, d, e = byte
        columns = [
            a << 2 | b >> 6,
            (b & 0x3F) << 4 | c >> 4,
            (c & 0x0F) << 6 | d >> 2,
            (d & 0x03) << 8 | e,
        ]
    else:
        a, b, c = byte
        columns = [a << 4 | b >> 4, (b & 0x0F) << 8 | c]
    return np.stack(columns, axis=1).reshape(-1)[:values]
