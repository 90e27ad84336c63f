"""A changed value is found, a changed time is not."""

import base64
import json
from pathlib import Path

import h5py
import numpy as np
import pytest

from tests.golden.canonical import changes, content_of
from tests.golden.cases import CASES
from tests.golden.running import compare_case


def _hdf5(path: Path, *, value: float = 1.0, seconds: float = 3.0, version: str = "1.0") -> Path:
    with h5py.File(path, "w") as file:
        entry = file.create_group("entry")
        entry["values"] = np.array([value, 2.0])
        entry["values"].attrs["units"] = "N"
        entry["seconds/design"] = seconds
        entry["text"] = json.dumps({"versions": {"numpy": version}, "seed": 1})
    return path


def _json(path: Path, *, value: float = 1.0, seconds: float = 3.0, version: str = "1.0") -> Path:
    found = {"m": {"value": value, "list": [1, None]}, "seconds": seconds, "versions": {"numpy": version}}
    path.write_text(json.dumps(found), encoding="utf-8")
    return path


def _csv(path: Path, *, value: float = 1.0, seconds: float = 3.0, version: str = "1.0") -> Path:
    path.write_text(
        f"time (s),force (N),wall time (s),python\n0.1,{value},{seconds},{version}\n", encoding="utf-8"
    )
    return path


def _page(path: Path, *, value: float = 1.0, seconds: float = 3.0, version: str = "1.0") -> Path:
    tables = f"<table><caption>Versions</caption><tr><td>{version}</td></tr></table>"
    path.write_text(f"<p>m = {value}</p><p>took {seconds} s</p>{tables}<p>end</p>", encoding="utf-8")
    return path


def _output(path: Path, *, value: float = 1.0, seconds: float = 3.0, version: str = "1.0") -> Path:
    del version
    path.write_text(f"  m          {value}\n  wall time  {seconds} s\n", encoding="utf-8")
    return path


def _vtu(path: Path, *, value: float = 1.0, seconds: float = 3.0, version: str = "1.0") -> Path:
    del seconds, version
    data = base64.b64encode(np.uint64(16).tobytes() + np.array([value, 2.0]).tobytes()).decode()
    array = f'<DataArray type="Float64" Name="force" format="binary">{data}</DataArray>'
    path.write_text(f'<VTKFile header_type="UInt64"><Piece>{array}</Piece></VTKFile>', encoding="utf-8")
    return path


PAGES = [(_page, "a.html"), (_output, "stdout_0.txt"), (_json, "stdout_1.txt")]
FILES = [(_hdf5, "a.h5"), (_json, "a.json"), (_csv, "a.csv"), (_vtu, "a.vtu"), *PAGES]


@pytest.mark.parametrize(("write", "name"), FILES)
def test_a_changed_value_is_found(write, name, tmp_path):
    one = content_of(write(tmp_path / f"old{name}"))
    other = content_of(write(tmp_path / f"new{name}", value=1.0 + 1e-12))
    assert len(changes(one, other)) == 1
    assert changes(one, content_of(write(tmp_path / f"new{name}"))) == []


@pytest.mark.parametrize(("write", "name"), FILES)
def test_a_changed_time_or_version_is_not(write, name, tmp_path):
    one = content_of(write(tmp_path / f"old{name}"))
    other = content_of(write(tmp_path / f"new{name}", seconds=12.5, version="2.1"))
    assert changes(one, other) == []


def test_the_largest_relative_difference_is_said(tmp_path):
    one, other = _hdf5(tmp_path / "a.h5"), _hdf5(tmp_path / "b.h5", value=1.01)
    (found,) = changes(content_of(one), content_of(other))
    assert found.key == "entry/values"
    assert found.said == "1 of 2 values differ, relatively by up to 0.0099"


def test_type_units_and_presence_count(tmp_path):
    one = content_of(_hdf5(tmp_path / "a.h5"))
    with h5py.File(_hdf5(tmp_path / "b.h5"), "a") as file:
        del file["entry/values"]
        file["entry/values"] = np.array([1.0, 2.0], dtype=np.float32)
    found = {one.key: one.said for one in changes(one, content_of(tmp_path / "b.h5"))}
    assert found["entry/values@units"] == "is missing"
    assert "float32" in found["entry/values"]


def test_places_are_masked_and_other_words_are_not(tmp_path):
    path = tmp_path / "warning.txt"
    path.write_text(f"wrote {tmp_path}/a.h5; damping 2.2673e-05 s, late by 1.07 ms\n", encoding="utf-8")
    text = content_of(path, {str(tmp_path): "<work>"})["text"]
    assert text == "wrote <work>/a.h5; damping 2.2673e-05 s, late by 1.07 ms"


def test_a_case_says_which_file_differs(tmp_path):
    for name, value in (("old", 1.0), ("new", 1.5)):
        (tmp_path / name / "files").mkdir(parents=True)
        facts = {"commands": [{"line": "kolsky", "code": 0}], "places": {}, "seconds": value}
        (tmp_path / name / "case.json").write_text(json.dumps(facts), encoding="utf-8")
        _json(tmp_path / name / "files" / "a.json", value=value)
    (tmp_path / "new" / "files" / "more.csv").write_text("a\n1\n", encoding="utf-8")
    said = compare_case(tmp_path / "old", tmp_path / "new")
    assert said[0] == "files/more.csv: is new"
    assert said[1].startswith("files/a.json: /m/value: 1 of 1 values differ, relatively by up to 0.33")
    assert compare_case(tmp_path / "old", tmp_path / "old") == []


def test_names_of_cases_are_their_own():
    assert len({case.name for case in CASES}) == len(CASES)
