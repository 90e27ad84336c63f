"""HDF5 files, and channels with clocks from the named arrays of MATLAB and HDF5 files."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.base.errors import InputError
from kolsky.base.files import regular
from kolsky.readers.contents import (
    SAMPLES_LIMIT,
    Channel,
    Clock,
    Contents,
    array_clock,
    check_samples,
    file_hash,
    find_column,
    head_of,
    stated_clock,
)
from kolsky.readers.header import HeaderClock, clock_of_numbers, si_unit, time_factor
from kolsky.readers.layout import Layout


@dataclass(frozen=True)
class NamedArray:
    """A column of numbers that is read on demand."""

    name: str
    """Path or name in the file; "signals[2]" is the second column of an array."""
    samples: int
    """Its length."""
    values: Callable[[], FloatArray]
    unit: str | None = None
    """Its unit, if the file states it."""
    keys: Mapping[str, float] = field(default_factory=dict)
    """Its numeric attributes, and those of the groups that contain it."""


TABLE_LIMIT = 5_000_000
"""Maximum number of values in a table of arrays."""


def array_lines(path: Path, arrays: Sequence[NamedArray]) -> list[str]:
    """Names and rows of the arrays with the greatest length, as tab-separated lines with all digits.

    Raises InputError if there is no array, or if there are too many numbers.
    """
    rows = max((array.samples for array in arrays), default=0)
    columns = [array for array in arrays if array.samples == rows]
    if not 0 < rows * len(columns) <= TABLE_LIMIT:
        message = f"has {rows * len(columns)} numbers in arrays of equal length"
        cure = "save the columns of the table as plain arrays of equal length"
        raise InputError(path, message, allowed=f"1 to {TABLE_LIMIT}", cure=cure)
    values = np.column_stack([array.values() for array in columns]).tolist()
    return ["\t".join(a.name for a in columns), *("\t".join(map(repr, row)) for row in values)]


def array_channels(
    path: Path, arrays: list[NamedArray], scalars: Mapping[str, float], layout: Layout
) -> dict[str, tuple[Channel, ...]]:
    """The arrays as fields `channels` and `times` of `Contents`, each signal with its clock.

    The clock comes from the layout, from keys such as "dt" and "t0", or from an array of times. This is the
    declared array, or an array of the same length named "t" or "time".

    ``scalars``: its single numbers, by name. ``layout``: the declared layout. Raises InputError if there is
    nothing to read, or if a declared array of times is missing.
    """
    by_name, stated = {array.name: array for array in arrays}, layout.time
    names, cure = list(by_name), "correct time in the layout"
    said = stated.values() if isinstance(stated, Mapping) else [] if stated is None else [stated]
    found = [find_column(path, names, str(one), "array", purpose=" of times", cure=cure) for one in said]
    times = [names[i] for i in found] or [name for name in names if _last(name) in ("t", "time", "times")]
    signals = [array for array in arrays if array.name not in times]
    if not signals:
        raise InputError(path, "holds no array of numbers but times", cure="save the signals as plain arrays")

    def clock_of(signal: NamedArray) -> Clock:
        header = clock_of_numbers(path, {**scalars, **signal.keys}, layout)
        interval, start = header.interval, header.start
        near = [t for t in times if by_name[t].samples == signal.samples]
        if isinstance(stated, Mapping):
            own = {f"/{str(key).removeprefix('/')}": str(time) for key, time in stated.items()}
            name = own.get(f"/{signal.name.removeprefix('/')}")
            near = [n for n in (name, f"/{name}") if n in by_name] if name is not None else near
        if interval is not None and (start is not None or not near):
            return stated_clock(interval, start, header.source)
        if not near:
            raise InputError(
                path,
                f"has no times for '{signal.name}' ({signal.samples} samples) and no interval"
                + (f" that is clear: {header.doubt}" if header.doubt else ""),
                cure='give in the layout time = "NAME", or interval = "100 ns"',
            )
        return clock_of_array(path, by_name[near[0]], layout, header)

    for signal in signals:
        check_samples(path, signal.name, signal.samples)

    def channel(array: NamedArray, number: int) -> Channel:
        return Channel(array.name, number, array.unit, array.samples, array.values, lambda: clock_of(array))

    return {
        "channels": tuple(channel(signal, number) for number, signal in enumerate(signals, start=1)),
        "times": tuple(channel(by_name[name], len(signals) + 1) for name in dict.fromkeys(times)),
    }


def clock_of_array(path: Path, array: NamedArray, layout: Layout, header: HeaderClock) -> Clock:
    """The clock of an array of times, combined with the declared start and interval.

    Raises InputError if the array does not contain such times, or if they contradict the declared interval.
    """
    unit = layout.time_unit or array.unit or "s"
    factor = time_factor(path, unit, f"the array '{array.name}'")
    values = array.values()
    if not np.isfinite(values).all():
        raise InputError(path, f"'{array.name}' holds NaN or infinity", cure="state the interval")
    values = values * factor

    def fault(message: str, sample: int | None, cure: str) -> InputError:
        return InputError(path, message, cure=cure)

    clock = array_clock(values, header, name=array.name, fault=fault)
    words = clock.source if layout.time_unit or array.unit else f"{clock.source}, taken as seconds"
    start = clock.start if layout.start is None else layout.start
    measured = None if clock.measured is None else clock.measured + (start - clock.start)
    return Clock(start, clock.interval, words, measured)


def columns_of(name: str, shape: tuple[int, ...]) -> list[tuple[str, int, int | None]]:
    """Name, length and column of the vectors in an array.

    The column of a vector is None. Empty for other arrays.

    The longer side is time. An array with more than 64 columns is not a set of signals.
    """
    long = [n for n in shape if n > 1]
    if len(long) == 1 and len(shape) <= 2:
        return [(name, long[0], None)]
    if len(long) == 2 and len(shape) == 2 and min(long) <= 64 and max(long) > min(long):
        return [(f"{name}[{i + 1}]", max(long), i) for i in range(min(long))]
    return []


def column_of(array: np.ndarray, column: int | None) -> FloatArray:
    """One of the columns that `columns_of` names, as numbers."""
    if column is None:
        return np.asarray(array, dtype=np.float64).ravel()
    return np.asarray(array if array.shape[0] > array.shape[1] else array.T, dtype=np.float64)[
        :, column
    ].copy()


def _unit_of_array(text: object) -> str | None:
    """A unit that a file gives as text or bytes. None for other types."""
    if isinstance(text, bytes):
        text = text.decode("utf-8", "replace")
    return text.strip() if isinstance(text, str) and si_unit(text) is not None else None


def _last(name: str) -> str:
    return name.rsplit("/", 1)[-1].lower()


_MOST = 2000
"""Maximum number of objects in a file."""


@dataclass
class Inside:
    """The datasets and attributes of a file."""

    path: Path
    arrays: list[NamedArray] = field(default_factory=list)
    """Its vectors."""
    scalars: dict[str, float] = field(default_factory=dict)
    """Its single numbers, by path."""
    texts: dict[str, str] = field(default_factory=dict)
    """Its attributes as texts, by path."""
    others: list[str] = field(default_factory=list)
    """Names and kinds of all other datasets."""

    def group(self, group: Any, prefix: str = "", above: Mapping[str, float] = MappingProxyType({})) -> None:
        """Collect a group. External links raise an error, and objects without numbers are listed."""
        import h5py

        keys = {**above, **self._attributes(prefix, group.attrs)}
        if not prefix:
            self.scalars |= keys
        for name in group:
            if not isinstance(name, str):
                raise self._refused(f"has the name {name!r}, which is not a text", "export it again")
            full = f"{prefix}/{name}"
            if name.startswith("#"):  # MATLAB's store of references
                continue
            if len(self.arrays) + len(self.scalars) > _MOST or full.count("/") > 16:
                raise self._refused(f"holds more than {_MOST} objects", "export the signals alone")
            if not isinstance(group.get(name, getlink=True), h5py.HardLink):
                raise self._refused(f"'{full}' is a link", "save the signals themselves in one file")
            item = group[name]
            if isinstance(item, h5py.Group):
                self.group(item, full, keys)
            elif isinstance(item, h5py.Dataset):
                self._dataset(item, full, keys)

    def _dataset(self, item: Any, full: str, keys: Mapping[str, float]) -> None:
        """Collect a dataset: its vectors, the fields of a table of records, or a single number."""
        fields = item.dtype.names or ()
        if item.shape is None or not (item.dtype.kind in "fiu" or (fields and len(item.shape) == 1)):
            self.others.append(f"{full} ({'text' if item.dtype.kind in 'OSU' else item.dtype})"[:100])
            return
        if item.is_virtual or item.external:
            raise self._refused(f"'{full}' lies in another file", "save the signals themselves in one file")
        if fields:
            for name in fields:
                if item.dtype[name].kind not in "fiu" or item.dtype[name].shape:
                    self.others.append(f"{full}/{name}")
                    continue
                check_samples(self.path, f"{full}/{name}", max(2, item.size))
                values = partial(_values, self.path, full, None, {}, name)
                self.arrays.append(NamedArray(f"{full}/{name}", item.size, values))
            return
        if item.size == 1:
            self.scalars[full] = float(np.ravel(item[()])[0])
            return
        own = {**keys, **_numbers(item.attrs)}
        units = (_unit_of_array(item.attrs.get(key)) for key in ("unit", "units", "Unit", "Units", "YUnits"))
        unit = next(filter(None, units), None)
        for name, samples, column in columns_of(full, item.shape):
            if item.size > SAMPLES_LIMIT:
                message = f"'{full}' has {item.size} samples, more than the {SAMPLES_LIMIT} that are read"
                raise self._refused(message, "export the time span of the test only")
            values = partial(_values, self.path, full, column, own)
            self.arrays.append(NamedArray(name, samples, values, unit, own))

    def _attributes(self, place: str, attributes: Any) -> dict[str, float]:
        """Collect the attributes of a group as texts; the numbers among them."""
        for key in attributes:
            value = attributes[key]
            text = value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)
            if len(text) <= 500:
                self.texts[f"{place}/{key}"] = text
        return _numbers(attributes)

    def _refused(self, message: str, cure: str) -> InputError:
        return InputError(self.path, message, cure=cure)


def inside(path: Path) -> Inside:
    """The datasets and attributes of a file. Raises InputError as `read`."""
    import h5py

    found = Inside(path)
    try:
        with h5py.File(regular(path), "r") as file:
            found.group(file)
    except (OSError, RuntimeError, KeyError, ValueError, TypeError) as error:
        message = f"is not an HDF5 file that can be read ({error})"
        raise InputError(path, message, cure="copy or export it again") from None
    return found


def sniff(path: Path) -> bool:
    """True if a file begins with the signature of HDF5 and is not a MATLAB file."""
    return head_of(path, 8) == b"\x89HDF\r\n\x1a\n"


def read(path: Path, layout: Layout) -> Contents:
    """Read all channels of a file. The name of a channel is its path, "/scope/CH1".

    Raises InputError if it is damaged or not HDF5, if it has too many objects, or a dataset in another file.
    """
    sha256 = file_hash(path)
    found = _some_arrays(path)
    others = found.others
    return Contents(
        path=path,
        sha256=sha256,
        **array_channels(path, found.arrays, found.scalars, layout),
        facts={"format": "hdf5"} | ({"without numbers": ", ".join(others[:20])} if others else {}),
        metadata=found.texts,
    )


def table_lines(path: Path, _sheet: str | None) -> tuple[str, list[str]]:
    """Hash, and the vectors of equal length as tab-separated lines. Raises InputError as `read`."""
    return file_hash(path), array_lines(path, _some_arrays(path).arrays)


def _some_arrays(path: Path) -> Inside:
    """As `inside`, with at least one vector."""
    found = inside(path)
    if not found.arrays:
        raise InputError(
            path,
            "holds no array of numbers" + (f", but {', '.join(found.others[:8])}" if found.others else ""),
            cure="save the signals as plain arrays of numbers",
        )
    return found


def _values(
    path: Path, full: str, column: int | None, keys: Mapping[str, float], name: str | None = None
) -> FloatArray:
    """A vector, a column of an array, or the field `name` of a table of records."""
    import h5py

    try:
        with h5py.File(regular(path), "r") as file:
            array = file[full][()] if name is None else file[full][name]
    except (OSError, KeyError, RuntimeError, ValueError) as error:
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
