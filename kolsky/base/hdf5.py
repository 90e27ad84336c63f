"""HDF5 files: groups and datasets with units.

They are written completely or not at all, and checked when they are read. The files follow the NeXus
convention: `NXentry` and `NXdata` groups with `signal` and `axes`, and `units` on every array. Text is
fixed-length UTF-8, without pickles or object types. When a file is read, link, type, shape, size and unit of
a dataset are checked before its values. `kolsky.base.hdf5_records` joins records to the files.
"""

from __future__ import annotations

import posixpath
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from dic.files import regular, replacing
from kolsky.base.errors import InputError

if TYPE_CHECKING:
    import h5py  # loaded when a file is opened: the forms of records serve other files too

STORED = {"f": "<f8", "i": "<i8", "b": "|b1", "u": "|u1"}
"""Kind of a dataset -> its type in the file: float64, int64, bool, small unsigned integer."""
IN_MEMORY: dict[str, Any] = {"driver": "core", "backing_store": False}
"""A file is built in memory and then written in one step. On a full disk, HDF5 would otherwise print a
traceback for every open object. This output cannot be caught."""
OpenGroup: TypeAlias = "h5py.Group"
"""A group of an open file."""
COMPRESSED_FROM = 4096
"""A dataset with at least this number of values is compressed."""
MOST_PACKING = 20
"""Largest ratio of a file's uncompressed size to its compressed size. Measurements compress to a half, zeros
to a thousandth."""
FREELY_UNPACKED = 2**28
"""Uncompressed size that is allowed for any file [bytes]."""


class Refused(Exception):
    """A part of a file cannot be used. The message does not name the file."""


@dataclass(frozen=True)
class Format:
    """Name and version in the attributes `format` and `format_version` of a file."""

    name: str
    """Name of the format."""
    version: int = 1
    """Version that is written."""
    readable: tuple[int, ...] = (1,)
    """Versions that are read."""
    largest: int = 2**30
    """Upper limit of the size that is read from a file [bytes]."""


@dataclass(frozen=True)
class Place:
    """A group or dataset of an open file."""

    file: h5py.File
    """The file."""
    path: str
    """Path in it, without the leading slash."""
    version: int
    """Version of the file's format."""
    largest: int
    """Upper limit of the size that is read from the file [bytes]."""
    sizes: dict[str, int] = field(default_factory=dict)
    """Sizes of the named dimensions found so far. A dimension of one name has one size."""
    unit: str = ""
    """Unit of the record it belongs to, see `kolsky.base.hdf5_records.RECORD_UNIT`."""
    taken: list[int] = field(default_factory=lambda: [0])
    """Number of bytes read from the file so far, one count for all its places."""

    @property
    def name(self) -> str:
        """Last part of the path."""
        return posixpath.basename(self.path)

    @property
    def parent(self) -> Place:
        """The group around it."""
        return self.at("..")

    def at(self, path: str) -> Place:
        """A place relative to this one, with the same dimensions."""
        return replace(self, path=posixpath.normpath(f"{self.path}/{path}"))

    def inside(self, path: str = ".") -> Place:
        """A place with a separate copy of the known dimensions.

        Dimensions added to the copy are not shared.
        """
        return replace(self.at(path), sizes=dict(self.sizes))

    def exists(self) -> bool:
        """True if any object, including a link, has this name."""
        return opened_group(self.parent).get(self.name, getlink=True) is not None


@contextmanager
def creating(path: Path, **attributes: Any) -> Iterator[h5py.File]:
    """A new file with these attributes, moved to `path` at the end. If this fails, an older file is kept."""
    import h5py

    with replacing(Path(path)) as partial:
        with h5py.File(partial, "w", **IN_MEMORY) as file:
            for key, value in attributes.items():
                file.attrs[key] = value
            yield file
            file.flush()
            image = file.id.get_file_image()
        partial.write_bytes(image)


@contextmanager
def writing(path: Path, form: Format, **attributes: Any) -> Iterator[Place]:
    """The place "entry" of a new file of a format, see `creating`. The group is not made yet."""
    head = {"format": form.name, "format_version": form.version, "default": "entry"}
    with creating(path, **head, **attributes) as file:
        yield Place(file, "entry", form.version, form.largest)


@contextmanager
def adding_to(path: Path) -> Iterator[OpenGroup]:
    """The group "entry" of an existing file, to write more into it."""
    import h5py

    with h5py.File(path, "r+", **IN_MEMORY) as file:
        yield file["entry"]
        file.flush()
        image = file.id.get_file_image()
    with replacing(Path(path)) as partial:
        partial.write_bytes(image)


@contextmanager
def reading(path: Path, form: Format, *, cure: str) -> Iterator[Place]:
    """Context with the group "entry" of a file of a format, before any data are read.

    Raises InputError if the file is missing, damaged or of another format or version, or if a part of it is
    rejected inside the block. The message is one line and ends with `cure`.
    """
    import h5py

    try:
        with h5py.File(regular(path), "r") as file:
            name, version = (_attribute(file, key) for key in ("format", "format_version"))
            if not (name == form.name and version in form.readable):
                known = " or ".join(map(str, form.readable))
                raise Refused(
                    f"version {version} of the format {name!r}, expected version {known} of {form.name!r}"
                )
            most = max(FREELY_UNPACKED, MOST_PACKING * Path(path).stat().st_size)
            yield Place(file, "entry", int(str(version)), min(form.largest, most))
    except FileNotFoundError:
        raise InputError(path, "no such file", cure=cure) from None
    except Refused as error:
        raise InputError(path, str(error), cure=cure) from None
    except (OSError, RuntimeError, KeyError, TypeError, ValueError, AttributeError) as error:
        # Exceptions of h5py on damaged files. Their messages can have several lines.
        cause = " ".join(str(error).split())
        raise InputError(path, f"not a readable HDF5 file ({cause})", cure=cure) from error


def stored_attribute(path: Path, form: Format, name: str) -> object:
    """One attribute of a file. None if there is no such file, format, version or attribute."""
    import h5py

    try:
        with h5py.File(regular(path), "r") as file:
            found = (_attribute(file, "format"), _attribute(file, "format_version"))
            return _attribute(file, name) if found == (form.name, form.version) else None
    except (OSError, RuntimeError, KeyError, TypeError, ValueError):
        return None


def _attribute(file: h5py.File, name: str) -> object:
    value = file.attrs.get(name)
    return value.item() if isinstance(value, np.generic) else value


def group(parent: OpenGroup, name: str, nx_class: str = "NXcollection", **attributes: Any) -> OpenGroup:
    """Make a group of a NeXus class."""
    made = parent.create_group(name)
    made.attrs["NX_class"] = nx_class
    for key, value in attributes.items():
        made.attrs[key] = value
    return made


def data(parent: OpenGroup, name: str, signal: str, *axes: str) -> OpenGroup:
    """Make a group of data that names its signal and its axes."""
    return group(parent, name, "NXdata", signal=signal, axes=list(axes))


def put(
    parent: OpenGroup, name: str, values: Any, unit: str | None, *, kind: str = "f", **attributes: Any
) -> None:
    """Write numbers as a dataset of the kind, with their unit and attributes.

    With the unit None, no unit is written.
    """
    array = np.asarray(values, dtype=STORED[kind])
    large = array.size > COMPRESSED_FROM
    packing = {"compression": "gzip", "compression_opts": 1, "shuffle": True} if large else {}
    dataset = parent.create_dataset(name, data=array, **packing)
    if unit is not None:
        dataset.attrs["units"] = unit
    for key, value in attributes.items():
        dataset.attrs[key] = value


def put_text(parent: OpenGroup, name: str, value: str | Iterable[str], *, escape: bool = False) -> None:
    """Write a text or several as a dataset of fixed-length UTF-8.

    Raises ValueError if a text has a NUL character or a lone surrogate. With `escape`, they are written as
    escapes.
    """
    import h5py

    texts = [value] if isinstance(value, str) else list(value)
    if escape:
        texts = [text.replace("\0", "\\0").encode("utf-8", "backslashreplace").decode() for text in texts]
    if any("\0" in text for text in texts):
        place = f"{parent.name.rstrip('/')}/{name}"
        raise ValueError(f"{place}: a text with a NUL character cannot be stored")
    encoded = [text.encode() for text in texts]
    array = np.array(encoded, dtype=h5py.string_dtype("utf-8", max([1, *map(len, encoded)])))
    parent.create_dataset(name, data=array.reshape(()) if isinstance(value, str) else array)


def shape_problem(shape: tuple[int, ...], dimensions: str, sizes: dict[str, int]) -> str:
    """Compare a shape with named dimensions.

    Returns the problem in words, "" if there is none. New named dimensions are added to `sizes`. ``shape``:
    the shape. ``dimensions``: names of its dimensions, "" for a scalar. A number is a size: "frames points
    3". ``sizes``: size of every known dimension.
    """
    names = dimensions.split()
    if len(shape) != len(names):
        return f"has {len(shape)} dimensions, expected {len(names)} ({dimensions or 'scalar'})"
    for name, size in zip(names, shape, strict=True):
        expected = int(name) if name.isdigit() else sizes.setdefault(name, size)
        if size != expected:
            return f"has size {size} along {name!r} of ({dimensions}), expected {expected}"
    return ""


def take(place: Place, unit: str | None, dimensions: str, kind: str) -> Any:
    """Values of a dataset, or text (kind "t"), after a check of its link, type, shape, size and unit."""
    import h5py

    dataset, where = opened(place, h5py.Dataset), f"/{place.path}"
    if dataset.external or dataset.is_virtual:
        raise Refused(f"{where}: its values lie in another file, expected them in this one")
    right = dataset.dtype.kind == "S" if kind == "t" else dataset.dtype == np.dtype(STORED[kind])
    if not right:
        raise Refused(f"{where}: type {dataset.dtype}, expected {'text' if kind == 't' else STORED[kind]}")
    if dataset.shape is None:
        raise Refused(f"{where}: holds nothing, expected ({dimensions or 'scalar'})")
    wrong = shape_problem(dataset.shape, dimensions, place.sizes)
    if wrong:
        raise Refused(f"{where}: {wrong}")
    place.taken[0] += dataset.size * dataset.dtype.itemsize
    if place.taken[0] > place.largest:
        raise Refused(f"{where}: the file unpacks to more than {place.largest} bytes")
    if unit is not None and dataset.attrs.get("units") != unit:
        raise Refused(f"{where}: in {dataset.attrs.get('units')!r}, must be in {unit!r}")
    return _text(dataset[()], where) if kind == "t" else dataset[()]


def _text(value: Any, where: str) -> str | tuple[str, ...]:
    try:
        if isinstance(value, np.ndarray):
            return tuple(text.decode() for text in value.tolist())
        return bytes(value).decode()
    except UnicodeDecodeError as error:
        raise Refused(f"{where}: not UTF-8 ({error.reason})") from None


def opened(place: Place, kind: type) -> Any:
    """The object at a place, reached over hard links. A soft or external link could lead to any place."""
    import h5py

    here: Any = place.file
    done = ""
    for part in place.path.split("/"):
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


def opened_group(place: Place) -> OpenGroup:
    """The group at a place, as `opened`."""
    import h5py

    found: OpenGroup = opened(place, h5py.Group)
    return found
