"""The codec of dataclasses and HDF5, tested with small records. Files are read with h5py only."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import Enum, IntEnum, StrEnum
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from kolsky.base.errors import InputError
from kolsky.base.hdf5 import Format, put, put_text, reading, shape_problem, stored_attribute, writing
from kolsky.base.hdf5_records import (
    COLLECTION,
    RECORD_UNIT,
    Choice,
    Columns,
    Flags,
    Floats,
    Group,
    GroupName,
    IntegerAttribute,
    Integers,
    Json,
    Named,
    Pair,
    Pairs,
    Part,
    Parts,
    Record,
    Text,
    numbers,
    nxdata,
)

FORMAT = Format("test", version=2, readable=(1, 2), largest=8000)
CURE = "write it again"


class Kind(StrEnum):
    GOOD = "as it should be"
    BAD = "spoilt"


class Colour(Enum):
    RED = 1
    BLUE = 2


class Ending(IntEnum):
    FOUND = 0
    LOST = 4


@dataclass(frozen=True)
class Gauge:
    name: str
    unit: str
    value: float
    parts: Mapping[str, float]

    @property
    def twice(self) -> float:
        return 2.0 * self.value


@dataclass(frozen=True)
class Point:
    x: float
    label: str


@dataclass(frozen=True)
class Everything:
    time: np.ndarray
    path: np.ndarray
    number: int
    sizes: tuple[int, int]
    flags: np.ndarray
    kind: Kind
    colours: tuple[Colour, ...]
    words: tuple[str, ...]
    settings: Mapping[str, Any]
    gauges: Mapping[str, Gauge]
    points: tuple[Point, ...]
    others: tuple[Point, ...]
    two: tuple[np.ndarray, np.ndarray]
    counts: Mapping[Ending, int]
    inner: Point | None = None
    sensor: tuple[int, int] | None = None
    later: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.number < 0:
            raise ValueError(f"number must not be negative, got {self.number}")


GAUGE = Record(
    Gauge,
    COLLECTION,
    {"name": GroupName(), "unit": Text(), "value": Floats(RECORD_UNIT), "parts": numbers(RECORD_UNIT)}
    | {"twice": Floats(RECORD_UNIT, attributes={"coverage_factor": 2}, derived=True)},
)
POINT = Record(Point, COLLECTION, {"x": Floats("m"), "label": Text()})
ROW = Record(Point, None, {"x": Floats("m", "rows", at="row_x"), "label": Text("rows", at="row_label")})
EVERYTHING = Record(
    Everything,
    Group("NXentry", {"default": "line"}),
    {
        "time": Floats("s", "times", at="line/time"),
        "path": Floats("m", "times 2", at="line/path"),
        "number": Integers("1"),
        "sizes": Integers("1", "2", as_tuple=True),
        "flags": Flags("1", "times"),
        "kind": Choice(Kind),
        "colours": Choice(Colour, "colours"),
        "words": Text("words"),
        "settings": Json(),
        "gauges": Named(GAUGE),
        "points": Parts(POINT),
        "others": Columns(ROW),
        "two": Pair(Floats("px", "times")),
        "counts": Pairs(
            Integers("1", "counts", at="count_of"), Integers("1", "counts", at="count"), at=".", as_key=Ending
        ),
        "inner": Part(POINT, optional=True),
        "sensor": IntegerAttribute(2, optional=True),
        "later": numbers("N", since=2),
    },
    groups={"line": nxdata("path", "time")},
    links={"line/again": "line/time"},
)
FULL = Everything(
    time=np.array([0.0, 1.0, 2.0]),
    path=np.arange(6.0).reshape(3, 2),
    number=7,
    sizes=(3, 4),
    flags=np.array([True, False, True]),
    kind=Kind.BAD,
    colours=(Colour.BLUE, Colour.RED),
    words=("größer", "", "試"),
    settings={"a": [1, None], "b": {"c": "d"}},
    gauges={"front": Gauge("front", "N", 2.5, {"noise": 0.1}), "back": Gauge("back", "m/s", -1.0, {})},
    points=(Point(1.0, "one"), Point(2.0, "two")),
    others=(Point(3.0, "three"), Point(4.0, "four")),
    two=(np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0, np.nan])),
    counts={Ending.LOST: 5, Ending.FOUND: 0},
    inner=Point(9.0, "nine"),
    sensor=(640, 480),
    later={"drag": 0.25},
)


def write(path: Path, value: Everything = FULL) -> Path:
    with writing(path, FORMAT, made_from="nothing") as place:
        EVERYTHING.write(place, value)
    return path


def read(path: Path) -> Everything:
    with reading(path, FORMAT, cure=CURE) as place:
        return EVERYTHING.read(place)


def test_a_record_comes_back_as_it_was(tmp_path: Path) -> None:
    again = read(write(tmp_path / "a.h5"))
    for name, value in vars(FULL).items():
        found = getattr(again, name)
        if isinstance(value, np.ndarray):
            assert found.dtype == value.dtype
        if name in ("time", "path", "flags", "two"):
            np.testing.assert_array_equal(found, value)
        else:
            assert found == value, name
            assert type(found) is type(value), name


def test_what_is_none_is_stored_as_nothing(tmp_path: Path) -> None:
    path = write(tmp_path / "a.h5", replace(FULL, inner=None, sensor=None))
    again = read(path)
    assert again.inner is None
    assert again.sensor is None
    with h5py.File(path) as file:
        assert "inner" not in file["entry"]
        assert "sensor" not in file["entry"].attrs


def test_the_file_as_a_stranger_reads_it(tmp_path: Path) -> None:
    """Names, types, units and attributes, with h5py alone."""
    with h5py.File(write(tmp_path / "a.h5")) as file:
        assert dict(file.attrs) == {
            "format": "test", "format_version": 2, "default": "entry", "made_from": "nothing"
        }  # fmt: skip
        entry = file["entry"]
        assert entry.attrs["NX_class"] == "NXentry"
        assert list(entry["line"].attrs["axes"]) == ["time"]
        assert entry["line/time"].attrs["units"] == "s"
        assert entry["line/time"].dtype == np.float64
        assert entry["number"].dtype == np.int64
        assert entry["flags"].dtype == np.bool_
        assert entry["line/again"] == entry["line/time"]  # one dataset, two names
        assert entry["kind"].asstr()[()] == "spoilt"
        assert entry["colours"].asstr()[()].tolist() == ["BLUE", "RED"]
        assert entry["gauges/front/value"].attrs["units"] == "N"
        assert entry["gauges/back/value"].attrs["units"] == "m/s"
        assert entry["gauges/back/parts/values"].attrs["units"] == "m/s"
        assert entry["gauges/front/twice"][()] == 5.0
        assert entry["gauges/front/twice"].attrs["coverage_factor"] == 2
        assert entry["two_1"][()][1] == 5.0
        assert entry["row_x"][()].tolist() == [3.0, 4.0]
        assert entry["count_of"][()].tolist() == [4, 0]
        text = h5py.check_string_dtype(entry["words"].dtype)
        assert (text.encoding, text.length) == ("utf-8", len("größer".encode()))


def test_what_an_older_version_does_not_hold_has_its_default(tmp_path: Path) -> None:
    path = write(tmp_path / "a.h5")
    with h5py.File(path, "r+") as file:
        del file["entry/later"]
    with pytest.raises(InputError, match="/entry/later: missing"):
        read(path)
    with h5py.File(path, "r+") as file:
        file.attrs["format_version"] = 1
    assert read(path).later == {}


@pytest.mark.parametrize("version", [0, 3, "2"])
def test_another_version_is_refused(tmp_path: Path, version: object) -> None:
    path = write(tmp_path / "a.h5")
    with h5py.File(path, "r+") as file:
        file.attrs["format_version"] = version
    with pytest.raises(InputError, match=f"version {version} of .*expected version 1 or 2 of 'test'.*{CURE}"):
        read(path)
    assert stored_attribute(path, FORMAT, "made_from") is None


def test_one_attribute_is_read_alone(tmp_path: Path) -> None:
    path = write(tmp_path / "a.h5")
    assert stored_attribute(path, FORMAT, "made_from") == "nothing"
    assert stored_attribute(path, FORMAT, "else") is None
    assert stored_attribute(tmp_path / "none.h5", FORMAT, "made_from") is None


def _put(name: str, values: Any, unit: str | None = None) -> Any:
    def change(file: h5py.File) -> None:
        del file[f"entry/{name}"]
        made = file["entry"].create_dataset(name, data=values)
        if unit is not None:
            made.attrs["units"] = unit

    return change


DAMAGE = {
    "another unit": (lambda f: f["entry/line/time"].attrs.__setitem__("units", "ms"), "must be in 's'"),
    "no unit": (_put("line/time", np.zeros(3)), "in None, must be in 's'"),
    "unit of the record": (lambda f: f["entry/gauges/front"]["value"].attrs.modify("units", "m"), "in 'N'"),
    "a size of its own": (_put("line/path", np.zeros((3, 3)), "m"), "size 3 along '2'.*expected 2"),
    "two sizes of one name": (_put("two_1", np.zeros(4), "px"), "size 4 along 'times'.*expected 3"),
    "too large": (
        lambda f: [
            _put(name, np.zeros((1001, *more)), unit)(f)
            for name, more, unit in (("line/time", (), "s"), ("line/path", (2,), "m"))
        ],
        "more than 8000 bytes",
    ),
    "text that is no choice": (_put("kind", np.bytes_(b"odd")), "'odd', expected one of 'as it should be'"),
    "a choice that is none": (_put("colours", np.array([b"RED", b"PINK"])), "'PINK', expected one of 'RED'"),
    "groups not numbered": (lambda f: f["entry/points"].move("1", "2"), "numbered from 0"),
    "a name that is a path": (_put("gauges/names", np.array([b"../points"])), "is not a parameter name"),
    "an attribute": (lambda f: f["entry"].attrs.__setitem__("sensor", [1, 2, 3]), "expected 2 integers"),
    "columns of two lengths": (_put("row_x", np.zeros(3), "m"), "row_label: has size 2"),
    "refused by the dataclass": (lambda f: f["entry/number"].__setitem__((), -1), "must not be negative"),
    "a link for an optional part": (
        lambda f: (f["entry"].pop("inner", None), f["entry"].__setitem__("inner", h5py.SoftLink("/no"))),
        "SoftLink",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", DAMAGE)
def test_a_damaged_file_is_refused_in_one_line(case: str, tmp_path: Path) -> None:
    change, says = DAMAGE[case]
    path = write(tmp_path / "a.h5")
    with h5py.File(path, "r+") as file:
        change(file)
    with pytest.raises(InputError, match=says) as refused:
        read(path)
    assert str(refused.value).startswith(f"{path}: ")
    assert "\n" not in str(refused.value)


def test_shapes_that_disagree_are_not_written(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="/entry/line/path: has size 2 along 'times'"):
        write(tmp_path / "a.h5", replace(FULL, path=np.zeros((2, 2))))
    assert list(tmp_path.iterdir()) == []


def test_dimensions() -> None:
    sizes = {"a": 3}
    assert shape_problem((3, 5, 2), "a b 2", sizes) == ""
    assert sizes == {"a": 3, "b": 5}
    assert "expected 5" in shape_problem((3, 4), "a b", sizes)
    assert "expected 3 (a b 2)" in shape_problem((3, 5), "a b 2", sizes)
    assert shape_problem((), "", sizes) == ""
    assert "scalar" in shape_problem((1,), "", sizes)


def test_a_table_must_name_every_field() -> None:
    with pytest.raises(TypeError, match="Point and of its table differ: label"):
        Record(Point, COLLECTION, {"x": Floats("m")})
    with pytest.raises(TypeError, match="differ: y"):
        Record(Point, COLLECTION, {"x": Floats("m"), "label": Text(), "y": Floats("m")})


def test_text_is_refused_or_escaped(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        with pytest.raises(ValueError, match="/a: a text with a NUL"):
            put_text(file, "a", "x\0y")
        with pytest.raises(ValueError, match="surrogate"):
            put_text(file, "a", "x\udcff")
        put_text(file, "a", ["x\0y", "x\udcff"], escape=True)
        assert file["a"].asstr()[()].tolist() == ["x\\0y", "x\\udcff"]


def test_a_large_dataset_is_compressed_and_the_same(tmp_path: Path) -> None:
    values = np.random.default_rng(1).normal(size=4097)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        put(file, "large", values, "m", sigma=0.5)
        put(file, "small", values[:4096], None)
        assert (file["large"].compression, file["small"].compression) == ("gzip", None)
        assert file["large"][()].tobytes() == values.tobytes()
        assert dict(file["large"].attrs) == {"units": "m", "sigma": 0.5}
        assert dict(file["small"].attrs) == {}
