"""A frozen dataclass as a group of an HDF5 file: one table says unit, dimensions and place of every field.

::

    ROUTE = Record(
        Route,
        COLLECTION,
        {
            "name": Text(),
            "parameters": numbers("SI"),
            "cost": Floats("1"),
            "sigma": numbers("SI"),
        },
    )
    ROUTE.write(place, route)
    route = ROUTE.read(place)

A table must name every field of its dataclass, so a field that is added and forgotten here fails at import.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, Generic, TypeVar

import h5py

from kolsky.base import hdf5
from kolsky.base.hdf5 import Place, Refused, opened, take
from kolsky.base.hdf5_items import COLLECTION, Group, IntegerAttribute, Item, begin

T = TypeVar("T")


@dataclass(frozen=True)
class Record(Generic[T]):
    """The form of a dataclass in the file."""

    make: Callable[..., T]
    """The dataclass."""
    group: Group | None
    """Its group; None if its fields lie in the group of the record around it, whose dimensions it shares."""
    fields: Mapping[str, Item]
    """One entry a field, in the order of writing and reading."""
    groups: Mapping[str, Group] = field(default_factory=dict, kw_only=True)
    """Further groups that the `at` of fields lead to: path -> group."""
    derived: Mapping[str, Item] = field(default_factory=dict, kw_only=True)
    """Properties that are written for other readers and not read back."""
    links: Mapping[str, str] = field(default_factory=dict, kw_only=True)
    """Second names of datasets: new path -> path."""

    def __post_init__(self) -> None:
        known = {f.name for f in fields(self.make)}  # type: ignore[arg-type]
        if known != set(self.fields):
            differ = sorted(known ^ set(self.fields))
            raise TypeError(f"fields of {self.make.__name__} and of its table differ: {', '.join(differ)}")

    def write(self, place: Place, value: T) -> None:
        """Write a record as the group `place`.

        Raises
        ------
        ValueError
            If shapes disagree with each other, or a text cannot be stored.
        """
        place = begin(self.group, place)
        for path, made in self.groups.items():
            made.make(place.at(path))
        place = replace(place, unit=getattr(value, "unit", place.unit))
        for name, item in (*self.fields.items(), *self.derived.items()):
            found = getattr(value, name)
            if not (found is None and item.optional):
                item.write(place.at(item.at or name), found)
        for name, path in self.links.items():
            place.file[place.at(name).path] = place.file[place.at(path).path]

    def read(self, place: Place) -> T:
        """Read a record back.

        Raises
        ------
        kolsky.base.hdf5.Refused
            If something is missing, not as it was written, or refused by the dataclass itself.
        """
        if self.group is not None:
            opened(place, h5py.Group)
            place = place.inside()
        values: dict[str, Any] = {}
        for name, item in self.fields.items():
            if place.version < item.since:
                continue
            here = place.at(item.at or name)
            if item.optional and not isinstance(item, IntegerAttribute) and not here.exists():
                values[name] = None
                continue
            values[name] = item.read(here)
            if name == "unit":
                place = replace(place, unit=values[name])
        try:
            return self.make(**values)
        except ValueError as error:
            raise Refused(f"/{place.path}: {error}") from None


@dataclass(frozen=True)
class Part(Item):
    """A record."""

    record: Record[Any]
    """Its form."""

    def write(self, place: Place, value: Any) -> None:
        self.record.write(place, value)

    def read(self, place: Place) -> Any:
        return self.record.read(place)


@dataclass(frozen=True)
class Parts(Item):
    """A tuple of records: groups "0", "1", ..."""

    record: Record[Any]
    """Their form."""

    def write(self, place: Place, value: Any) -> None:
        COLLECTION.make(place)
        for number, one in enumerate(value):
            self.record.write(place.at(str(number)), one)

    def read(self, place: Place) -> Any:
        found = set(opened(place, h5py.Group).keys())
        expected = [str(number) for number in range(len(found))]
        if found != set(expected):
            raise Refused(f"/{place.path}: groups {sorted(found)[:5]}, expected them numbered from 0")
        return tuple(self.record.read(place.at(name)) for name in expected)


@dataclass(frozen=True)
class Named(Item):
    """A mapping of names to records: the dataset "names" and a group a name."""

    record: Record[Any]
    """Their form."""

    def write(self, place: Place, value: Any) -> None:
        COLLECTION.make(place)
        hdf5.put_text(place.file, place.at("names").path, tuple(value))
        for name, one in value.items():
            if not name.isidentifier():
                raise ValueError(
                    f"parameter name {name!r} cannot name a group of the file; use letters, digits and _"
                )
            self.record.write(place.at(name), one)

    def read(self, place: Place) -> Any:
        names = take(place.inside("names"), None, "entries", "t")
        for name in names:
            if not name.isidentifier():
                raise Refused(f"/{place.path}/names: {name!r} is no parameter name")
        return {name: self.record.read(place.at(name)) for name in names}


@dataclass(frozen=True)
class GroupName(Item):
    """A text that is the name of the record's group, see `Named`."""

    at: str = field(default=".", kw_only=True)

    def write(self, place: Place, value: Any) -> None:
        pass

    def read(self, place: Place) -> Any:
        return place.name


@dataclass(frozen=True)
class Pair(Item):
    """A tuple of two, one dataset or group each, whose names end in `ends`."""

    item: Item
    """The form of each."""
    ends: tuple[str, str] = ("_0", "_1")
    """Appended to the path."""

    def write(self, place: Place, value: Any) -> None:
        for end, one in zip(self.ends, value, strict=True):
            self.item.write(self._place(place, end), one)

    def read(self, place: Place) -> Any:
        return tuple(self.item.read(self._place(place, end)) for end in self.ends)

    def _place(self, place: Place, end: str) -> Place:
        return replace(place, path=place.path + end)


@dataclass(frozen=True)
class Columns(Item):
    """A tuple of records as datasets of one length, one a field, in the group of the record around them."""

    record: Record[Any]
    """Their form; every field has the one dimension."""
    at: str = field(default=".", kw_only=True)

    def write(self, place: Place, value: Any) -> None:
        for name, item in self.record.fields.items():
            item.write(place.at(item.at or name), [getattr(one, name) for one in value])

    def read(self, place: Place) -> Any:
        form = self.record.fields
        columns = [item.read(place.at(item.at or name)) for name, item in form.items()]
        return tuple(
            self.record.make(**dict(zip(form, row, strict=True))) for row in zip(*columns, strict=True)
        )
