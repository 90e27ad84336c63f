"""Datasets of a result file, written with their units, and read again trusting nothing in them.

Of a file that is read, link, type, shape and size of a dataset are checked before its values.
"""

from collections.abc import Mapping
from typing import Any

import h5py
import numpy as np

from kolsky.results.layout import NUMBERS, STORED, Table, shape_problem

LARGEST_DATASET = 2**30
"""Largest dataset that is read [bytes]; a dense mesh at every frame takes 1e7."""


class Refused(Exception):
    """One dataset that cannot be used, said without the file's name."""


def group(parent: h5py.Group, name: str, nx_class: str, **attributes: Any) -> h5py.Group:
    """Make a group of a NeXus class."""
    made = parent.create_group(name)
    made.attrs["NX_class"] = nx_class
    for key, value in attributes.items():
        made.attrs[key] = value
    return made


def data(parent: h5py.Group, name: str, signal: str, *axes: str) -> h5py.Group:
    """Make a group of data that names its signal and its axes."""
    return group(parent, name, "NXdata", signal=signal, axes=list(axes))


def safe(name: str) -> str:
    """A parameter's name, refused with a ValueError if it cannot name a group."""
    if not name.isidentifier():
        raise ValueError(
            f"parameter name {name!r} cannot name a group of the file; use letters, digits and _"
        )
    return name


def write(
    parent: h5py.Group,
    table: Table,
    source: Mapping[str, Any],
    dims: dict[str, int],
    *,
    unit: str | None = None,
) -> None:
    """Write the datasets of `table`; sizes of named dimensions are checked against and added to `dims`."""
    for name, (own_unit, dimensions, kind) in table.items():
        value = source[name]
        if kind == "t":
            texts = np.array([value] if isinstance(value, str) else list(value), dtype=object)
            if any("\0" in text for text in texts):
                raise ValueError(f"{parent.name}/{name}: a text with a NUL character cannot be stored")
            encoded = [text.encode() for text in texts]
            longest = max([1, *map(len, encoded)])
            array = np.array(encoded, dtype=h5py.string_dtype("utf-8", longest))
            array = array.reshape(()) if isinstance(value, str) else array
        else:
            array = np.asarray(value, dtype=STORED[kind])
        wrong = shape_problem(array.shape, dimensions, dims)
        if wrong:
            raise ValueError(f"{parent.name}/{name}: {wrong}")
        large = array.size > 4096
        packing = {"compression": "gzip", "compression_opts": 4, "shuffle": True} if large else {}
        dataset = parent.create_dataset(name, data=array, **packing)
        if kind != "t":
            dataset.attrs["units"] = own_unit if unit is None else unit


def write_numbers(parent: h5py.Group, name: str, values: Mapping[str, float], unit: str = "SI") -> None:
    """Write a group of named numbers."""
    source = {"names": tuple(values), "values": list(values.values())}
    write(group(parent, name, "NXcollection"), NUMBERS, source, {}, unit=unit)


def read_numbers(file: h5py.File, place: str) -> dict[str, float]:
    """Read what `write_numbers` wrote."""
    values = read(file, place, NUMBERS, {})
    return dict(zip(values["names"], values["values"].tolist(), strict=True))


def numbered(file: h5py.File, place: str) -> list[str]:
    """Paths of the sub-groups "0", "1", ... of a group, which must be all it holds."""
    found = set(opened(file, place, h5py.Group).keys())
    expected = [str(number) for number in range(len(found))]
    if found != set(expected):
        raise Refused(f"/{place}: groups {sorted(found)[:5]}, expected them numbered from 0")
    return [f"{place}/{number}" for number in expected]


def read(file: h5py.File, place: str, table: Table, dims: dict[str, int]) -> dict[str, Any]:
    """Read the datasets of `table`; sizes of named dimensions are checked against and added to `dims`."""
    opened(file, place, h5py.Group)
    values: dict[str, Any] = {}
    for name, (_, dimensions, kind) in table.items():
        where = f"/{place}/{name}"
        dataset = opened(file, f"{place}/{name}", h5py.Dataset)
        if dataset.external or dataset.is_virtual:
            raise Refused(f"{where}: its values lie in another file, expected them in this one")
        expected = STORED[kind]
        if not (dataset.dtype.kind == "S" if kind == "t" else dataset.dtype == np.dtype(expected)):
            raise Refused(f"{where}: type {dataset.dtype}, expected {expected}")
        if dataset.shape is None:
            raise Refused(f"{where}: holds nothing, expected ({dimensions or 'scalar'})")
        wrong = shape_problem(dataset.shape, dimensions, dims)
        if wrong:
            raise Refused(f"{where}: {wrong}")
        if dataset.size * dataset.dtype.itemsize > LARGEST_DATASET:
            raise Refused(f"{where}: more than {LARGEST_DATASET} bytes")
        values[name] = _text(dataset[()], where) if kind == "t" else dataset[()]
        if kind != "t" and not dimensions:
            values[name] = values[name].item()
    return values


def opened(file: h5py.File, place: str, kind: type) -> Any:
    """The object at `place`, reached over hard links only (a soft or external link could lead anywhere)."""
    here: Any = file
    done = ""
    for part in place.split("/"):
        done += "/" + part
        link = here.get(part, getlink=True) if isinstance(here, h5py.Group) else None
        if link is None:
            raise Refused(f"{done}: missing")
        if not isinstance(link, h5py.HardLink):
            raise Refused(f"{done}: a {type(link).__name__}, expected the object itself")
        here = here[part]
    if not isinstance(here, kind):
        raise Refused(f"{done}: a {type(here).__name__}, expected a {kind.__name__}")
    return here


def _text(value: Any, where: str) -> str | tuple[str, ...]:
    try:
        if isinstance(value, np.ndarray):
            return tuple(text.decode() for text in value.tolist())
        return bytes(value).decode()
    except UnicodeDecodeError as error:
        raise Refused(f"{where}: not UTF-8 ({error.reason})") from None
