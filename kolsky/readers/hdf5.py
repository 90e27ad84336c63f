"""HDF5: datasets of numbers, with the clock in attributes, scalars or a dataset of times.

Attributes and scalar datasets of a dataset's own group and of the groups above it count: "dt", "t0", and the
XInc and XOrg, YInc and YOrg of Keysight oscilloscopes.
"""

from pathlib import Path
from typing import Any

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.base.errors import InputError
from kolsky.base.files import regular
from kolsky.readers.arrays import NamedArray, array_channels, column_of, columns_of, known_unit
from kolsky.readers.contents import SAMPLES_LIMIT, Contents, Layout, file_hash, head_of

BINARY = True

_MOST = 2000
"""Most objects in a file that are looked at."""


def sniff(path: Path) -> bool:
    """True if a file begins with the signature of HDF5 and is not MATLAB's."""
    return head_of(path, 8) == b"\x89HDF\r\n\x1a\n"


def read(path: Path, layout: Layout) -> Contents:
    """Read what a file holds; a channel's name is its path, "/scope/CH1".

    Raises
    ------
    InputError
        If it is no HDF5 file or damaged, has too many objects, or a dataset lies in another file.
    """
    sha256 = file_hash(path)
    arrays, scalars, metadata = inside(path)
    return Contents(
        path=path,
        sha256=sha256,
        channels=array_channels(path, arrays, scalars, layout),
        facts={"format": "hdf5"},
        metadata=metadata,
    )


def inside(path: Path) -> tuple[list[NamedArray], dict[str, float], dict[str, str]]:
    """Vectors, single numbers and texts of a file.

    Raises
    ------
    InputError
        As `read`.
    """
    import h5py

    arrays: list[NamedArray] = []
    scalars: dict[str, float] = {}
    texts: dict[str, str] = {}
    try:
        with h5py.File(regular(path), "r") as file:
            _attributes("/", file.attrs, scalars, texts)
            _walk(path, file, "", {}, arrays, scalars, texts)
    except (OSError, RuntimeError, KeyError, ValueError, TypeError) as error:
        raise InputError(
            path, f"is not an HDF5 file that can be read ({error})", cure="copy or export it again"
        ) from None
    return arrays, scalars, texts


def _walk(
    path: Path,
    group: Any,
    prefix: str,
    above: dict[str, float],
    arrays: list[NamedArray],
    scalars: dict[str, float],
    texts: dict[str, str],
) -> None:
    """Collect a group; links to elsewhere are refused, what holds no numbers is passed over."""
    import h5py

    keys = {**above, **_numbers(group.attrs)}
    for name in group:
        if not isinstance(name, str):
            raise InputError(path, f"has the name {name!r}, which is no text", cure="export it again")
        full = f"{prefix}/{name}"
        if name.startswith("#"):  # MATLAB's store of references
            continue
        if len(arrays) + len(scalars) > _MOST or full.count("/") > 16:
            raise InputError(path, f"holds more than {_MOST} objects", cure="export the signals alone")
        if not isinstance(group.get(name, getlink=True), h5py.HardLink):
            raise InputError(path, f"'{full}' is a link", cure="save the signals themselves in one file")
        item = group[name]
        if isinstance(item, h5py.Group):
            _attributes(full, item.attrs, {}, texts)
            _walk(path, item, full, keys, arrays, scalars, texts)
        elif isinstance(item, h5py.Dataset):
            _dataset(path, item, full, keys, arrays, scalars)


def _dataset(
    path: Path,
    item: Any,
    full: str,
    keys: dict[str, float],
    arrays: list[NamedArray],
    scalars: dict[str, float],
) -> None:
    if item.dtype.kind not in "fiu" or item.shape is None:
        return
    if item.is_virtual or item.external:
        raise InputError(
            path, f"'{full}' lies in another file", cure="save the signals themselves in one file"
        )
    if item.size == 1:
        scalars[full] = float(item[()].ravel()[0]) if item.shape else float(item[()])
        return
    own = {**keys, **_numbers(item.attrs)}
    unit = next(
        (u for key in ("unit", "units", "Unit", "Units", "YUnits") if (u := known_unit(item.attrs.get(key)))),
        None,
    )
    for name, samples, column in columns_of(full, item.shape):
        if item.size > SAMPLES_LIMIT:
            raise InputError(
                path,
                f"'{full}' has {item.size} samples, more than the {SAMPLES_LIMIT} that are read",
                cure="export the time span of the test only",
            )

        def values(full: str = full, column: int | None = column, own: dict[str, float] = own) -> FloatArray:
            return _values(path, full, column, own)

        arrays.append(NamedArray(name, samples, values, unit, own))


def _values(path: Path, full: str, column: int | None, keys: dict[str, float]) -> FloatArray:
    import h5py

    try:
        with h5py.File(regular(path), "r") as file:
            array = file[full][()]
    except (OSError, KeyError, RuntimeError) as error:
        raise InputError(path, f"'{full}' cannot be read ({error})", cure="copy or export it again") from None
    values = column_of(array, column)
    if array.dtype.kind in "iu" and "YInc" in keys:  # Keysight stores the recorder's codes
        values = keys["YInc"] * values + keys.get("YOrg", 0.0)
    return values


def _numbers(attributes: Any) -> dict[str, float]:
    found = {}
    for key in attributes:
        value = attributes[key]
        if np.ndim(value) == 0 and np.asarray(value).dtype.kind in "fiu":
            found[str(key)] = float(value)
    return found


def _attributes(place: str, attributes: Any, scalars: dict[str, float], texts: dict[str, str]) -> None:
    scalars.update(_numbers(attributes))
    for key in attributes:
        value = attributes[key]
        text = value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)
        if len(text) <= 500:
            texts[f"{place.rstrip('/')}/{key}"] = text
