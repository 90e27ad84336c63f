"""The form of one field in an HDF5 file: unit, dimensions and place of numbers, texts, choices, mappings."""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum, StrEnum
from typing import Any, ClassVar

import h5py
import numpy as np

from kolsky.base import hdf5
from kolsky.base.hdf5 import Place, Refused, opened, shape_problem, take

OWN = "unit of the record"
"""Stands for the unit that the record's own field `unit` names."""


@dataclass(frozen=True)
class Group:
    """NeXus class and attributes of a group."""

    nx_class: str = "NXcollection"
    """NeXus class."""
    attributes: Mapping[str, Any] = field(default_factory=dict)
    """Further attributes."""

    def make(self, place: Place) -> None:
        """Make the group."""
        hdf5.group(place.file, place.path, self.nx_class, **self.attributes)


COLLECTION = Group()


def nxdata(signal: str, *axes: str) -> Group:
    """A group of data that names its signal and its axes."""
    return Group("NXdata", {"signal": signal, "axes": list(axes)})


@dataclass(frozen=True, kw_only=True)
class Item:
    """The form of one field in the file."""

    at: str = ""
    """Path from the record's group; "" for the field's name."""
    since: int = 1
    """Version of the format that has it first; read from an older file the field has its default."""
    optional: bool = False
    """None is stored as nothing."""

    def write(self, place: Place, value: Any) -> None:
        """Write a value."""
        raise NotImplementedError

    def read(self, place: Place) -> Any:
        """Read it back.

        Raises
        ------
        kolsky.base.hdf5.Refused
            If it is missing or not as it was written.
        """
        raise NotImplementedError


@dataclass(frozen=True)
class Values(Item):
    """Numbers: a dataset with its unit and named dimensions, see `kolsky.base.hdf5.shape_problem`."""

    kind: ClassVar[str] = "f"
    unit: str
    """Unit, "1" if none; `OWN`."""
    dims: str = ""
    """Names of the dimensions, "" for a scalar."""
    as_tuple: bool = field(default=False, kw_only=True)
    """True if the field is a tuple of numbers, not an array."""
    attributes: Mapping[str, Any] = field(default_factory=dict, kw_only=True)
    """Further attributes of the dataset."""

    def write(self, place: Place, value: Any) -> None:
        array = np.asarray(value, dtype=hdf5.STORED[self.kind])
        _checked(place, array.shape, self.dims)
        hdf5.put(place.file, place.path, array, self._unit(place), kind=self.kind, **self.attributes)

    def read(self, place: Place) -> Any:
        value = take(place, self._unit(place), self.dims, self.kind)
        if not self.dims:
            return value.item()
        return tuple(value.tolist()) if self.as_tuple else value

    def _unit(self, place: Place) -> str:
        return place.unit if self.unit == OWN else self.unit


@dataclass(frozen=True)
class Floats(Values):
    """Float64."""


@dataclass(frozen=True)
class Integers(Values):
    """Int64."""

    kind = "i"


@dataclass(frozen=True)
class Flags(Values):
    """Bool."""

    kind = "b"


@dataclass(frozen=True)
class Text(Item):
    """A text, or a tuple of texts along a dimension."""

    dims: str = ""
    """Name of the dimension, "" for one text."""
    among: tuple[str, ...] = field(default=(), kw_only=True)
    """The only texts that are read; empty for any."""

    def write(self, place: Place, value: Any) -> None:
        _checked(place, () if isinstance(value, str) else (len(value),), self.dims)
        hdf5.put_text(place.file, place.path, value)

    def read(self, place: Place) -> Any:
        value = take(place, None, self.dims, "t")
        unknown = set((value,) if isinstance(value, str) else value) - set(self.among)
        if self.among and unknown:
            known = ", ".join(map(repr, self.among))
            raise Refused(f"/{place.path}: {min(unknown)!r}, expected one of {known}")
        return value


@dataclass(frozen=True)
class Choice(Item):
    """Members of an enum as text: the value of a text enum, else the name."""

    enum: type[Enum]
    """The enum."""
    dims: str = ""
    """Name of the dimension, "" for one member."""

    def write(self, place: Place, value: Any) -> None:
        said = self._said
        self._text.write(place, said(value) if isinstance(value, self.enum) else [said(v) for v in value])

    def read(self, place: Place) -> Any:
        by_text = {self._said(member): member for member in self.enum}
        value = self._text.read(place)
        return by_text[value] if isinstance(value, str) else tuple(by_text[text] for text in value)

    @property
    def _text(self) -> Text:
        return Text(self.dims, among=tuple(map(self._said, self.enum)))

    def _said(self, member: Enum) -> str:
        return str(member.value) if issubclass(self.enum, StrEnum) else member.name


@dataclass(frozen=True)
class Json(Item):
    """A mapping of JSON types as one JSON text."""

    def write(self, place: Place, value: Any) -> None:
        try:
            text = json.dumps(dict(value), allow_nan=False)
        except ValueError as error:
            raise ValueError(f"/{place.path}: {error}") from None
        hdf5.put_text(place.file, place.path, text)

    def read(self, place: Place) -> Any:
        try:
            value = json.loads(take(place, None, "", "t"))
        except (ValueError, RecursionError) as error:
            raise Refused(f"/{place.path}: not JSON ({error})") from None
        if not isinstance(value, dict):
            raise Refused(f"/{place.path}: a JSON {type(value).__name__}, expected an object")
        return value


@dataclass(frozen=True)
class IntegerAttribute(Item):
    """A tuple of integers as an attribute of the record's group."""

    size: int
    """Number of integers."""

    def write(self, place: Place, value: Any) -> None:
        place.file[place.parent.path].attrs[place.name] = value

    def read(self, place: Place) -> Any:
        found = opened(place.parent, h5py.Group).attrs.get(place.name)
        if found is None and self.optional:
            return None
        array = np.asarray(found)
        if array.dtype.kind not in "iu" or array.shape != (self.size,):
            raise Refused(f"/{place.path}: {found!r}, expected {self.size} integers")
        return tuple(array.tolist())


@dataclass(frozen=True)
class Pairs(Item):
    """A mapping as two datasets of one length: its keys and its values."""

    keys: Item
    """The keys; its `at` names the dataset."""
    values: Item
    """The values, likewise."""
    group: Group | None = None
    """Group that holds the two; None for the record's own, then `at` is "."."""
    key: Callable[[Any], Any] | None = None
    """Makes a key of what was stored; None if that is the key."""

    def write(self, place: Place, value: Any) -> None:
        place = begin(self.group, place)
        self.keys.write(place.at(self.keys.at), list(value))
        self.values.write(place.at(self.values.at), list(value.values()))

    def read(self, place: Place) -> Any:
        place = place.inside() if self.group else place
        keys = self.keys.read(place.at(self.keys.at))
        values = self.values.read(place.at(self.values.at)).tolist()
        return dict(zip(map(self.key, keys) if self.key else keys, values, strict=True))


def numbers(unit: str, **where: Any) -> Pairs:
    """Named numbers of one unit: a group with the datasets "names" and "values"."""
    return Pairs(Text("entries", at="names"), Floats(unit, "entries", at="values"), COLLECTION, **where)


def begin(group: Group | None, place: Place) -> Place:
    """Make the group of a record, if it has one of its own."""
    if group is None:
        return place
    group.make(place)
    return place.inside()


def _checked(place: Place, shape: tuple[int, ...], dims: str) -> None:
    wrong = shape_problem(shape, dims, place.sizes)
    if wrong:
        raise ValueError(f"/{place.path}: {wrong}")
