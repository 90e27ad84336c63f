"""Results on disk: no data are lost, no file is incomplete, and every file is checked."""

import csv
import json
import math
from collections.abc import Callable
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from synthetic import failed, synthetic

from dic.files import replacing
from kolsky.base.errors import InputError
from kolsky.base.files import write_tables
from kolsky.inverse.result import Identification
from kolsky.results.hdf5 import read_identification, write_identification
from kolsky.results.tables import end_columns, tables, to_json

CASES: dict[str, Callable[[], Identification]] = {
    "one parameter": synthetic,
    "two parameters": lambda: synthetic(("stiffness_factor", "friction")),
    "without nodes": lambda: synthetic(nodes=False),
    "failed": failed,
    "without warnings": lambda: replace(synthetic(nodes=False), warnings=()),
    "other letters": lambda: synthetic(shot="Schuß 7 / 試験"),
}


def assert_same(a: Any, b: Any, place: str = "result") -> None:
    """Equal to the last bit, type and shape."""
    assert type(a) is type(b), place
    if is_dataclass(a) and not isinstance(a, type):
        for f in fields(a):
            assert_same(getattr(a, f.name), getattr(b, f.name), f"{place}.{f.name}")
    elif isinstance(a, np.ndarray):
        assert a.dtype == b.dtype, place
        assert a.shape == b.shape, place
        assert a.tobytes() == b.tobytes(), place
    elif isinstance(a, dict):
        assert list(a) == list(b), place
        for key in a:
            assert_same(a[key], b[key], f"{place}[{key!r}]")
    elif isinstance(a, tuple):
        assert len(a) == len(b), place
        for i, (x, y) in enumerate(zip(a, b, strict=True)):
            assert_same(x, y, f"{place}[{i}]")
    else:
        assert a == b or (a != a and b != b), place  # NaN is itself here


@pytest.mark.parametrize("case", CASES)
def test_round_trip_is_exact(case: str, tmp_path: Path) -> None:
    result = CASES[case]()
    write_identification(tmp_path / "r.h5", result)
    assert_same(read_identification(tmp_path / "r.h5"), result)
    assert [p.name for p in tmp_path.iterdir()] == ["r.h5"]


def test_file_says_its_units_and_signals(tmp_path: Path) -> None:
    """Read with h5py alone, as a stranger would: units on every number, NXdata that names its signal."""
    write_identification(tmp_path / "r.h5", synthetic())
    seen: dict[str, str] = {}

    def look(name: str, item: h5py.Group | h5py.Dataset) -> None:
        if isinstance(item, h5py.Dataset):
            assert item.dtype.kind in "fibS", name
            if item.dtype.kind != "S":
                seen[name] = item.attrs["units"]
        elif item.attrs["NX_class"] == "NXdata":
            assert item.attrs["signal"] in item, name
            assert all(axis == "." or axis in item for axis in item.attrs["axes"]), name

    with h5py.File(tmp_path / "r.h5") as file:
        assert file["entry"].attrs["NX_class"] == "NXentry"
        assert file["entry"].attrs["default"] in file["entry"]
        file.visititems(look)
        # The interval of 1.12 with u = hypot(0.0019, 0.0016), by hand.
        u = math.sqrt(0.0019**2 + 0.0016**2)
        interval = file["entry/estimates/stiffness_factor/interval"][()]
    np.testing.assert_allclose(interval, [1.12 - 2 * u, 1.12 + 2 * u], rtol=1e-14)  # round-off
    assert seen["entry/force/force_measured"] == "N"
    assert seen["entry/profile/Z"] == "m"
    assert seen["entry/energy/elastic"] == "J"
    assert seen["entry/response/impulse_flyer"] == "N s"
    assert seen["entry/terms/sigma_phi_force"] == "N"


def _mismatched() -> Identification:
    result = synthetic()
    return replace(result, comparison=replace(result.comparison, force_sigma=np.ones(3)))


BROKEN = {
    "a shape in the middle of the file": (_mismatched, ValueError, "force_sigma"),
    "an object in provenance": (
        lambda: replace(synthetic(), provenance={"a": {"b": object()}}),
        TypeError,
        "a.b",
    ),
    "NUL in a text": (lambda: replace(synthetic(), shot="a\0b"), ValueError, "shot"),
    "a lone surrogate in a text": (lambda: replace(synthetic(), shot="a\udcff"), ValueError, "surrogate"),
}


@pytest.mark.parametrize("case", BROKEN)
def test_failure_half_way_leaves_the_old_file(case: str, tmp_path: Path) -> None:
    make, error, words = BROKEN[case]
    path = tmp_path / "r.h5"
    path.write_bytes(b"old")
    with pytest.raises(error, match=words):
        write_identification(path, make())
    assert path.read_bytes() == b"old"
    assert [p.name for p in tmp_path.iterdir()] == ["r.h5"]


def test_interrupt_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text("old")
    with pytest.raises(KeyboardInterrupt), replacing(path) as partial:  # noqa: PT012
        partial.write_text("ne")
        raise KeyboardInterrupt
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]


def _put(name: str, **dataset: Any) -> Callable[[h5py.File], None]:
    """Another dataset of the same unit in the place of one."""

    def change(file: h5py.File) -> None:
        attributes = dict(file[name].attrs)
        del file[name]
        file.create_dataset(name, **dataset).attrs.update(attributes)

    return change


def _link(name: str, link: Any) -> Callable[[h5py.File], None]:
    def change(file: h5py.File) -> None:
        del file[name]
        file[name] = link

    return change


def _virtual(file: h5py.File) -> None:
    layout = h5py.VirtualLayout(shape=(150,), dtype="<f8")
    layout[:] = h5py.VirtualSource("other.h5", "x", shape=(150,))
    del file["entry/force/force_sigma"]
    file.create_virtual_dataset("entry/force/force_sigma", layout).attrs["units"] = "N"


def _delete(file: h5py.File) -> None:
    del file["entry/energy/elastic"]


def _group(file: h5py.File) -> None:
    del file[TIME]
    file.create_group(TIME)


def _version(file: h5py.File) -> None:
    file.attrs["format_version"] = 99


TIME = "entry/force/force_time"
# Each case: what is done to a good file, and the word of the message that tells where.
MALICIOUS: dict[str, tuple[Callable[[h5py.File], None], str]] = {
    "object type": (_put(TIME, data=["x"] * 150, dtype=h5py.string_dtype()), TIME),
    "references": (_put(TIME, shape=(150,), dtype=h5py.ref_dtype), TIME),
    "text for numbers": (_put(TIME, data=np.array([b"1"] * 150)), TIME),
    "single precision": (_put(TIME, data=np.zeros(150, dtype="<f4")), TIME),
    "another length": (_put("entry/force/force_sigma", data=np.zeros(149)), "force_sigma"),
    "another rank": (_put(TIME, data=np.zeros((150, 1))), TIME),
    "no data space": (_put(TIME, data=h5py.Empty("<f8")), TIME),
    "8 TB of nothing": (_put(TIME, shape=(2**40,), dtype="<f8", chunks=(1024,)), TIME),
    "external link": (_link(TIME, h5py.ExternalLink("/etc/hosts", "/x")), TIME),
    "soft link": (_link(TIME, h5py.SoftLink("/entry/force/force_sigma")), TIME),
    "external storage": (_put(TIME, shape=(150,), dtype="<f8", external=[("/etc/hosts", 0, 1200)]), TIME),
    "virtual data": (_virtual, "force_sigma"),
    "group for a dataset": (_group, TIME),
    "missing dataset": (_delete, "entry/energy/elastic"),
    "unknown verdict": (_put("entry/estimates/stiffness_factor/outcome", data=np.bytes_("fine")), "outcome"),
    "unknown outcome": (_put("entry/response/outcomes", data=np.array([b"FINE"])), "outcomes"),
    "path for a name": (_put("entry/estimates/names", data=np.array([b"../terms"])), "names"),
    "not UTF-8": (_put("entry/shot", data=np.bytes_(b"\xff\xfe")), "entry/shot"),
    "not JSON": (_put("entry/provenance", data=np.bytes_(b"{")), "provenance"),
    "JSON, no object": (_put("entry/provenance", data=np.bytes_(b"[1]")), "provenance"),
    "JSON, too deep": (_put("entry/provenance", data=np.bytes_(b"[" * 200_000)), "provenance"),
    "another version": (_version, "version"),
}


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("good") / "r.h5"
    write_identification(path, synthetic(nodes=False))
    return path.read_bytes()


def _refused(path: Path, word: str) -> None:
    with pytest.raises(InputError) as caught:
        read_identification(path)
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith(f"{path}: ")
    assert word in message


@pytest.mark.parametrize("case", MALICIOUS)
def test_untrusted_file_is_refused_in_one_line(case: str, good: bytes, tmp_path: Path) -> None:
    path = tmp_path / "r.h5"
    path.write_bytes(good)
    change, word = MALICIOUS[case]
    with h5py.File(path, "r+") as file:
        change(file)
    _refused(path, word)


@pytest.mark.parametrize("share", [0.0, 0.01, 0.5, 0.999])
def test_truncated_file_is_refused_in_one_line(share: float, good: bytes, tmp_path: Path) -> None:
    (tmp_path / "r.h5").write_bytes(good[: int(share * len(good))])
    _refused(tmp_path / "r.h5", "HDF5")


def test_missing_and_foreign_files_are_refused(tmp_path: Path) -> None:
    _refused(tmp_path / "none.h5", "no such file")
    (tmp_path / "text.h5").write_text("time,force\n")
    _refused(tmp_path / "text.h5", "HDF5")
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["entry"] = 1.0
    _refused(tmp_path / "other.h5", "format")


def test_json_has_the_agreed_keys() -> None:
    result = synthetic(("stiffness_factor", "friction"))
    said = json.loads(json.dumps(to_json(result), allow_nan=False))
    for name, value, noise, numerical in (
        ("stiffness_factor", 1.12, 0.0019, 0.0016),
        ("friction", 0.42, 0.031, 0.012),
    ):
        one = said[name]
        u = math.sqrt(noise**2 + numerical**2)
        assert set(one) == {
            "value",
            "interval",
            "searched",
            "sigma",
            "sigma_noise",
            "sigma_numerical",
            "sigma_systematic",
            "mesh_shift",
            "on_mesh",
            "mesh_correction",
            "noise_parts",
            "numerical_parts",
            "unit",
            "outcome",
        }
        assert one["value"] == value
        assert one["sigma"] == pytest.approx(u, rel=1e-14)  # round-off
        assert one["interval"] == pytest.approx([value - 2 * u, value + 2 * u], rel=1e-14)
        assert one["outcome"] == "identified"
    assert said["stiffness_factor"]["mesh_shift"] == -0.0058
    assert said["warnings"] == [
        "the made-up specimen does not exist (nominal strain -0.8)",
        "nor does its flyer",
    ]
    assert said["shot"] == "made-up-01"
    assert [route["name"] for route in said["routes"]] == ["joint", "force only", "shape only", "paper"]
    assert said["terms"]["chi2"] == pytest.approx(said["terms"]["chi2_force"] + said["terms"]["chi2_shape"])
    assert said["fixed"] == {"poisson": 0.499, "damping": 2.5e-5}
    assert said["mesh"] == {"default": [16, 22], "refined": [24, 33]}
    assert {"surrogate", "seconds", "provenance"} <= set(said)


def test_json_has_no_nan() -> None:
    said = to_json(replace(failed(), provenance={"a": [float("inf")]}))
    json.dumps(said, allow_nan=False)  # raises on NaN and infinity
    assert said["stiffness_factor"]["value"] is None
    assert said["stiffness_factor"]["interval"] == [None, None]
    assert said["stiffness_factor"]["outcome"] == "no simulation of the design completed"
    assert said["provenance"] == {"a": [None]}


def test_json_refuses_a_parameter_that_would_hide_a_key() -> None:
    result = synthetic()
    estimate = result.estimates["stiffness_factor"]
    with pytest.raises(ValueError, match="'terms'"):
        to_json(replace(result, estimates={"terms": estimate}))


def test_csv_columns_carry_units_and_values(tmp_path: Path) -> None:
    result = synthetic()
    paths = write_tables(tmp_path / "new", tables(result))
    assert [p.name for p in paths] == ["force.csv", "profile.csv", "design.csv", "energy.csv"]
    made = {}
    for path in paths:
        with path.open(newline="", encoding="utf-8") as file:
            header, *rows = csv.reader(file)
        for name in header:
            assert name in ("run", "stage", "outcome", "frame", "element", "ending") or name.endswith(")"), (
                name
            )
        made[path.stem] = {name: [row[i] for row in rows] for i, name in enumerate(header)}
    c = result.comparison
    written = np.array(made["force"]["measured force (N)"], dtype=float)
    np.testing.assert_allclose(written, c.force_measured, rtol=5e-9)  # nine digits
    written = np.array(made["profile"]["Z simulated (m)"], dtype=float)
    np.testing.assert_allclose(written, c.Z_model, rtol=5e-9)
    assert made["profile"]["inside (0/1)"].count("0") == 16
    assert made["design"]["outcome"].count("INVERTED") == 1
    assert len(made["energy"]["time (s)"]) == 186
    # The residual closes the ledger: its column is external minus the seven others, each rounded to nine
    # digits, so to 8 * 5e-10 of the largest.
    ledger = {name: np.array(column, dtype=float) for name, column in made["energy"].items()}
    external, residual = ledger.pop("external (J)"), ledger.pop("residual (J)")
    del ledger["time (s)"]
    np.testing.assert_allclose(external - sum(ledger.values()), residual, atol=4e-9 * external.max())


def test_ends_of_runs_as_columns() -> None:
    """Element 0 is an element, -1 is none; a run that completed has no sentence."""
    design = synthetic().design
    count = len(design.points)
    outcomes = ["COMPLETED"] * count
    elements, places = np.full(count, -1), np.full((count, 2), np.nan)
    outcomes[1], elements[1], places[1] = "INVERTED", 0, (1.5e-3, 2.5e-3)
    columns = end_columns(
        replace(
            design,
            outcomes=tuple(outcomes),
            failed_elements=elements,
            failed_places=places,
            end_times=np.arange(count) * 1e-4,
        )
    )
    assert columns["end (s)"][1] == 1e-4
    assert columns["element"][:3] == ["", 0, ""]
    assert columns["element R (m)"][:3] == ["", 0.0015, ""]
    assert columns["element Y (m)"][:3] == ["", 0.0025, ""]
    assert columns["ending"][0] == columns["ending"][2] == ""
    assert columns["ending"][1].startswith("INVERTED at 100.0 us in element 0")
