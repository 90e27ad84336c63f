"""The stored form of a frozen dataclass.

One entry for each field gives its place in HDF5, JSON and tables, and its unit. A `Record` lists the fields
of one dataclass. Each field has an `Item`: numbers, texts, choices or mappings, with their unit and
dimensions, the key in JSON and the heading of the column in a table.
"""

import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from enum import Enum, StrEnum
from typing import Any, ClassVar, Generic, TypeVar

import numpy as np

from kolsky.base import hdf5
from kolsky.base.hdf5 import Place, Refused, opened_group, shape_problem, take

RECORD_UNIT = "unit of the record"
"""Placeholder for the unit in the record's field `unit`."""


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
    """First version of the format with this field. If an older file is read, the field has its default."""
    optional: bool = False
    """True if None is allowed. Nothing is then written for it."""
    derived: bool = False
    """True if the field is a property. It is written for other programs and not read back."""
    key: str | None = ""
    """Key in JSON. "" uses the field's name, None leaves it out of JSON."""
    heading: str | tuple[str, str] = ""
    """Heading of its column in a table, without the unit. A pair of numbers has two headings; "" means no
    column."""
    parameter: str = ""
    """Field with the name of the parameter that gives the unit of the numbers. It may also name one parameter
    for each number along the last dimension. "names.1" is the second of its names. "" if the unit is not that
    of a parameter."""

    def json(self, value: Any) -> Any:
        """The value in JSON, see `kolsky.base.files.jsonable`."""
        return value

    def columns(self, values: list[Any]) -> dict[str, Any]:
        """The column of a table, by its heading.

        Pairs have two columns. Without a heading, there is no column.
        """
        if isinstance(self.heading, tuple):
            return {name: [pair[end] for pair in values] for end, name in enumerate(self.heading)}
        return {self.heading: self._cells(values)} if self.heading else {}

    def _cells(self, values: Any) -> Any:
        return values

    def scaled(self, value: Any, record: Any, factor: Callable[[str], float]) -> Any:
        """The value, with numbers in a parameter's unit multiplied by that parameter's factor."""
        if not self.parameter:
            return value
        field_name, _, number = self.parameter.partition(".")
        names = getattr(record, field_name)
        if number:
            names = names[int(number)]
        by = factor(names) if isinstance(names, str) else np.array([factor(name) for name in names])
        if isinstance(value, Mapping):
            return {name: one * by for name, one in value.items()}
        return tuple(one * by for one in value) if isinstance(value, tuple) else value * by

    def write(self, place: Place, value: Any) -> None:
        """Write a value."""
        raise NotImplementedError

    def read(self, place: Place) -> Any:
        """Read it back.

        Raises kolsky.base.hdf5.Refused if it is missing or differs from the written form.
        """
        raise NotImplementedError


@dataclass(frozen=True)
class Values(Item):
    """Numbers: a dataset with its unit and named dimensions, see `kolsky.base.hdf5.shape_problem`."""

    kind: ClassVar[str] = "f"
    column_unit: ClassVar[str] = ""
    """Unit in a table. Empty: `unit`."""
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

    def columns(self, values: list[Any]) -> dict[str, Any]:
        unit = "" if self.unit == RECORD_UNIT else f" ({self.column_unit or self.unit})"
        return {f"{heading}{unit}": cells for heading, cells in super().columns(values).items()}

    def _unit(self, place: Place) -> str:
        return place.unit if self.unit == RECORD_UNIT else self.unit


@dataclass(frozen=True)
class Floats(Values):
    """Float64."""


@dataclass(frozen=True)
class Integers(Values):
    """Int64."""

    kind = "i"


@dataclass(frozen=True)
class Flags(Values):
    """Bool; 0 or 1 in a table."""

    kind = "b"
    column_unit = "0/1"

    def _cells(self, values: Any) -> Any:
        return np.asarray(values).astype(np.int64)


@dataclass(frozen=True)
class Text(Item):
    """A text, or a tuple of texts along a dimension."""

    dims: str = ""
    """Name of the dimension, "" for one text."""
    among: tuple[str, ...] = field(default=(), kw_only=True)
    """The only texts that are accepted. Empty: all texts are accepted."""

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
    """Members of an enum as text: the value of a text enum, otherwise the name."""

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

    def _cells(self, values: Any) -> Any:
        return [self._said(value) for value in values]

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
        found = opened_group(place.parent).attrs.get(place.name)
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
    """The values, in the same form."""
    group: Group | None = None
    """Group of the two datasets. None: the group of the record, and `at` is then "."."""
    as_key: Callable[[Any], Any] | None = None
    """Converts a stored value to a key. None if the stored value is the key."""

    def write(self, place: Place, value: Any) -> None:
        place = begin(self.group, place)
        self.keys.write(place.at(self.keys.at), list(value))
        self.values.write(place.at(self.values.at), list(value.values()))

    def read(self, place: Place) -> Any:
        place = place.inside() if self.group else place
        keys = self.keys.read(place.at(self.keys.at))
        values = self.values.read(place.at(self.values.at)).tolist()
        return dict(zip(map(self.as_key, keys) if self.as_key else keys, values, strict=True))


@dataclass(frozen=True)
class _ByParameter(Pairs):
    """Numbers by parameter, each in the unit of its parameter."""

    def scaled(self, value: Any, record: Any, factor: Callable[[str], float]) -> Any:
        return {name: one * factor(name) for name, one in value.items()}


def numbers(unit: str, **where: Any) -> Pairs:
    """Named numbers of one unit: a group with the datasets "names" and "values"."""
    return Pairs(Text("entries", at="names"), Floats(unit, "entries", at="values"), COLLECTION, **where)


def by_parameter(**where: Any) -> Pairs:
    """Numbers by parameter, each in the unit of its parameter; otherwise as `numbers`."""
    return _ByParameter(
        Text("entries", at="names"), Floats("SI", "entries", at="values"), COLLECTION, **where
    )


def begin(group: Group | None, place: Place) -> Place:
    """Make the group of a record, if it has a separate one."""
    if group is None:
        return place
    group.make(place)
    return place.inside()


def _checked(place: Place, shape: tuple[int, ...], dims: str) -> None:
    wrong = shape_problem(shape, dims, place.sizes)
    if wrong:
        raise ValueError(f"/{place.path}: {wrong}")


T = TypeVar("T")


@dataclass(frozen=True)
class Record(Generic[T]):
    """The form of a dataclass in the file."""

    make: Callable[..., T]
    """The dataclass."""
    group: Group | None
    """Its group. None if its fields are in the group of the enclosing record. It then shares the dimensions
    of that record."""
    fields: Mapping[str, Item]
    """One entry for each field, in the order of writing and reading."""
    groups: Mapping[str, Group] = field(default_factory=dict, kw_only=True)
    """Further groups used in the `at` of fields: path -> group."""
    links: Mapping[str, str] = field(default_factory=dict, kw_only=True)
    """Second names of datasets: new path -> path."""

    def __post_init__(self) -> None:
        known = {f.name for f in fields(self.make)}  # type: ignore[arg-type]
        listed = {name for name, item in self.fields.items() if not item.derived}
        if known != listed:
            differ = sorted(known ^ listed)
            raise TypeError(f"fields of {self.make.__name__} and of its table differ: {', '.join(differ)}")

    def write(self, place: Place, value: T) -> None:
        """Write a record as the group `place`.

        Raises ValueError if shapes disagree with each other, or if a text cannot be stored.
        """
        place = begin(self.group, place)
        for path, made in self.groups.items():
            made.make(place.at(path))
        place = replace(place, unit=getattr(value, "unit", place.unit))
        for name, item in self.fields.items():
            found = getattr(value, name)
            if not (found is None and item.optional):
                item.write(place.at(item.at or name), found)
        for name, path in self.links.items():
            place.file[place.at(name).path] = place.file[place.at(path).path]

    def read(self, place: Place) -> T:
        """Read a record back.

        Raises `Refused` if something is missing, differs from the written form, or is rejected by the
        dataclass.
        """
        if self.group is not None:
            opened_group(place)
            place = place.inside()
        values: dict[str, Any] = {}
        for name, item in self.fields.items():
            if item.derived or place.version < item.since:
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

    def json(self, value: T) -> dict[str, Any]:
        """The record as an object of JSON: its fields and properties by their keys."""
        return {
            item.key or name: item.json(getattr(value, name))
            for name, item in self.fields.items()
            if item.key is not None
        }

    def columns(self, values: Iterable[T]) -> dict[str, Any]:
        """A table with one row for each record: heading, with the unit, -> cells."""
        rows = list(values)
        made: dict[str, Any] = {}
        for name, item in self.fields.items():
            made |= item.columns([getattr(row, name) for row in rows])
        return made

    def table(self, value: T, dim: str) -> dict[str, Any]:
        """A table of the fields along one dimension.

        Fields of parts in the record's group are included.
        """
        made: dict[str, Any] = {}
        for name, item in self.fields.items():
            found = getattr(value, name)
            if isinstance(item, Part) and item.record.group is None:
                made |= item.record.table(found, dim)
            elif isinstance(item, Values | Text) and item.dims == dim:
                made |= item.columns(found)
        return made

    def scaled(self, value: T, factor: Callable[[str], float]) -> T:
        """The record, with every number in a parameter's unit multiplied by that parameter's factor."""
        made = {
            name: item.scaled(found, value, factor)
            for name, item in self.fields.items()
            if not item.derived and (found := getattr(value, name)) is not None
        }
        return replace(value, **made)  # type: ignore[type-var]


@dataclass(frozen=True)
class JsonOnly(Item):
    """A property that is written to JSON and tables but not to HDF5."""

    derived: bool = field(default=True, kw_only=True)

    def write(self, place: Place, value: Any) -> None:
        pass


@dataclass(frozen=True)
class Part(Item):
    """A record."""

    record: Record[Any]
    """Its form."""

    def write(self, place: Place, value: Any) -> None:
        self.record.write(place, value)

    def read(self, place: Place) -> Any:
        return self.record.read(place)

    def json(self, value: Any) -> Any:
        return None if value is None else self.record.json(value)

    def scaled(self, value: Any, record: Any, factor: Callable[[str], float]) -> Any:
        return self.record.scaled(value, factor)


@dataclass(frozen=True)
class Parts(Item):
    """A tuple of records: groups "0", "1", ..."""

    record: Record[Any]
    """Their form."""
    by: str = field(default="", kw_only=True)
    """Field with the key of each record in JSON; "" for a list."""
    only: str = field(default="", kw_only=True)
    """The only field of each record that is written to JSON; "" for the whole record."""

    def write(self, place: Place, value: Any) -> None:
        COLLECTION.make(place)
        for number, one in enumerate(value):
            self.record.write(place.at(str(number)), one)

    def read(self, place: Place) -> Any:
        found = set(opened_group(place).keys())
        expected = [str(number) for number in range(len(found))]
        if found != set(expected):
            raise Refused(f"/{place.path}: groups {sorted(found)[:5]}, expected them numbered from 0")
        return tuple(self.record.read(place.at(name)) for name in expected)

    def json(self, value: Any) -> Any:
        said = [self.record.json(one)[self.only] if self.only else self.record.json(one) for one in value]
        return dict(zip((getattr(one, self.by) for one in value), said, strict=True)) if self.by else said

    def scaled(self, value: Any, record: Any, factor: Callable[[str], float]) -> Any:
        return tuple(self.record.scaled(one, factor) for one in value)


@dataclass(frozen=True)
class Named(Item):
    """A mapping of names to records: the dataset "names" and one group for each name."""

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
                raise Refused(f"/{place.path}/names: {name!r} is not a parameter name")
        return {name: self.record.read(place.at(name)) for name in names}

    def json(self, value: Any) -> Any:
        return {name: self.record.json(one) for name, one in value.items()}

    def scaled(self, value: Any, record: Any, factor: Callable[[str], float]) -> Any:
        return {name: self.record.scaled(one, factor) for name, one in value.items()}


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
    """A tuple of two, with one dataset or group each. Their names end in `ends`."""

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
    """A tuple of records as datasets of one length, one for each field.

    They are in the group of the enclosing record.
    """

    record: Record[Any]
    """Their form. Every field has the one dimension."""
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
