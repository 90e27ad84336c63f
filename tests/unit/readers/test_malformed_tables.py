"""Tables of laboratories: read correctly, or rejected with cause and cure."""

from pathlib import Path

import h5py
import numpy as np
import openpyxl
import pytest
import scipy.io

from kolsky.base.errors import InputError
from kolsky.readers.layout import Layout
from kolsky.readers.measured_tables import WantedColumn, read_columns, read_frame_table
from kolsky.readers.recordings import list_channels, read_recordings, read_scope
from kolsky.readers.table import Column, read_table

STRAIN = 0.01 * np.arange(1, 13)
STRESS = 2.5 * np.arange(1, 13)
HEAD = "strain (1),stress (kPa)"
ROWS = [f"{e:.3f},{s:.2f}" for e, s in zip(STRAIN, STRESS, strict=True)]
GERMAN = [row.replace(",", ";").replace(".", ",") for row in ROWS]
HEAD_GERMAN = HEAD.replace(",", ";")
THOUSANDS = [f"{e:.3f}".replace(".", ",") + f";{s}.000,00" for e, s in zip(STRAIN, range(1, 13), strict=True)]


def text(*lines: str, encoding: str = "utf-8") -> bytes:
    return "\n".join(lines).encode(encoding)


READ_RIGHT = {
    "byte order mark": text(HEAD, *ROWS, encoding="utf-8-sig"),
    "UTF-16": text(HEAD, *ROWS, encoding="utf-16"),
    "UTF-16 without a mark": text(HEAD, *ROWS, encoding="utf-16-le"),
    "a delimiter ends every line": text(f"{HEAD},", *(f"{row}," for row in ROWS)),
    "a delimiter ends the rows": text(HEAD, *(f"{row}," for row in ROWS)),
    "a delimiter ends the names": text(f"{HEAD},", *ROWS),
    "quoted decimal commas": text(
        HEAD, *('"' + row.replace(";", '","') + '"' for row in GERMAN), "", encoding="cp1252"
    ),
    "blanks that do not break": text(HEAD, *(row.replace(",", ",\u00a0") for row in ROWS)),
}


@pytest.mark.parametrize("name", READ_RIGHT)
def test_what_means_one_thing_only_is_read(name: str, tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes(READ_RIGHT[name])
    table = read_table(path)
    np.testing.assert_array_equal(table.values(Column("stress (kPa)")), STRESS)
    read, _ = read_columns(
        path, {"e": WantedColumn("strain", "1", pure=True), "s": WantedColumn("stress", "Pa")}
    )
    np.testing.assert_allclose(read["e"], STRAIN, rtol=1e-12)
    np.testing.assert_allclose(read["s"], 1e3 * STRESS, rtol=1e-12)


REFUSED = {
    "nothing": (b"", "is empty"),
    "blank lines": (b"\n \n\n", "is empty"),
    "only names": (text(HEAD), r"has a header but no data|fewer than 3 lines of numbers"),
    "two tables": (text(HEAD, *ROWS, "", HEAD, *ROWS), r"line 14: is an empty line.*is there a second table"),
    "two tables without a line between": (text(HEAD, *ROWS, HEAD, *ROWS), r"line 14: .*a second table below"),
    "two tables side by side": (text(f"{HEAD},{HEAD}", *(f"{r},{r}" for r in ROWS)), "is there 2 times"),
    "NaN": (text(HEAD, *ROWS[:5], "0.055,NaN", *ROWS[5:]), r"line 7: .*not a finite.*leave the line out"),
    "infinity": (text(HEAD, *ROWS[:5], "0.055,Inf", *ROWS[5:]), r"line 7: .*not a finite number"),
    "dashes": (text(HEAD, *ROWS[:5], "0.055,---", *ROWS[5:]), r"line 7: .*marks a missing value"),
    "an empty field": (text(HEAD, *ROWS[:5], "0.055,", *ROWS[5:]), r"line 7: .*the field is empty"),
    "a remark below": (text(HEAD, *ROWS, "Mean,16.2"), r"line 14: .*are there remarks, a mean"),
    "the decimal sign changes": (
        text(HEAD_GERMAN, *GERMAN[:6], *(row.replace(",", ";") for row in ROWS[6:])),
        r"line 7: has the number '0,060', .*one decimal sign",
    ),
    "a decimal sign for each column": (
        text(HEAD_GERMAN, *(f"0,{i:03d};{2.5 * i:.2f}" for i in range(1, 13))),
        r"one decimal sign",
    ),
    "decimal commas between commas": (
        text(HEAD, *(row.replace(";", ",") for row in GERMAN)),
        r"line 2: .*commas decimal signs too",
    ),
    "points between thousands": (text(HEAD_GERMAN, *THOUSANDS), r"without signs between thousands"),
    "blanks between thousands": (
        text(HEAD_GERMAN, *(row.replace(".", " ") for row in THOUSANDS)),
        r"without signs between thousands",
    ),
    "units behind numbers": (text(HEAD, *(f"{row} kPa" for row in ROWS)), r"without a unit behind them"),
    "exponents of Fortran": (text(HEAD, *(f"{row}D+00" for row in ROWS)), r"exponent with E, not with D"),
    "long minus signs": (text(HEAD, *(f"−{row}" for row in ROWS)), r"longer dash"),
    "a workbook's bytes": (b"PK\x03\x04" + bytes(range(200)), r"Excel workbook.*named as text.*\.xlsx"),
    "a document": (b"%PDF-1.7\n" + bytes(range(200)), r"PDF document"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
@pytest.mark.parametrize("door", ["table", "columns"])
def test_what_cannot_be_a_table_is_refused_by_its_cause(name: str, door: str, tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    data, words = REFUSED[name]
    path.write_bytes(data)
    wanted = {"e": WantedColumn("strain", "1", pure=True), "s": WantedColumn("stress", "Pa", "kPa")}
    with pytest.raises(InputError, match=words):
        read_columns(path, wanted) if door == "columns" else every_value(path)


def every_value(path: Path) -> None:
    table = read_table(path)
    for column in table.names[:2]:
        table.values(Column(column))


def workbook(path: Path, rows: list[list[object]]) -> openpyxl.Workbook:
    book = openpyxl.Workbook()
    for row in rows:
        book.active.append(row)
    book.save(path)
    return book


PAIRS: list[list[object]] = [list(pair) for pair in zip(STRAIN.tolist(), STRESS.tolist(), strict=True)]


def test_merged_names_hidden_sheets_and_sheets_by_name(tmp_path: Path) -> None:
    path = tmp_path / "a.xlsx"
    workbook(path, [["strain (1)", None, "stress (kPa)"], *([e, 0.5, s] for e, s in PAIRS)])
    assert [c.name for c in list_channels(path)] == ["strain (1)", "2", "stress (kPa)"]
    book = workbook(path, [["strain (1)", "stress (kPa)"], *PAIRS])
    other = book.create_sheet("settings")
    other.append(["gain", 10.0])
    other.sheet_state = "hidden"
    book.save(path)
    np.testing.assert_array_equal(read_table(path).values(Column("stress (kPa)")), STRESS)
    other.sheet_state = "visible"
    book.save(path)
    with pytest.raises(InputError, match=r"has 2 sheets with data: \['Sheet', 'settings'\]"):
        read_table(path)
    named = read_table(path, layout=Layout(sheet="Sheet"))
    np.testing.assert_array_equal(named.values(Column("stress (kPa)")), STRESS)


@pytest.mark.parametrize(
    ("cells", "words"),
    [
        (["0,1", "2,5"], r"row 1\d|row 2.*make numbers of the cells that are text"),
        ([0.1, "=A2*25"], r"without numbers are 'stress \(kPa\)'|a formula that was never calculated"),
    ],
)
def test_cells_that_only_look_like_numbers(cells: list[object], words: str, tmp_path: Path) -> None:
    path = tmp_path / "a.xlsx"
    workbook(path, [["strain (1)", "stress (kPa)"], *([cells] * 12)])
    with pytest.raises(InputError, match=words):
        read_table(path).values(Column("stress (kPa)"))
    with pytest.raises(InputError, match=words):
        read_columns(path, {"s": WantedColumn("stress", "Pa")})


def test_structures_records_groups_and_texts_in_files_of_arrays(tmp_path: Path) -> None:
    mat, h5 = tmp_path / "a.mat", tmp_path / "a.h5"
    scipy.io.savemat(mat, {"test": {"strain": STRAIN, "stress": STRESS}})
    with pytest.raises(InputError, match=r"test \(struct\).*'-struct'"):
        read_table(mat)
    cells = np.empty((1, 2), dtype=object)
    cells[0, 0] = cells[0, 1] = np.zeros((3, 3))
    scipy.io.savemat(mat, {"DIC3DPPresults": {"Points3D": cells}})
    with pytest.raises(InputError, match=r"of DuoDIC or MultiDIC.*'Points3D_X'"):
        read_table(mat)
    with h5py.File(mat, "w") as file:  # as MATLAB 7.3 has it: a cell is an array of references
        file["#refs#/a"] = np.zeros((3, 3))
        file["DIC3DPPresults/Points3D"] = np.array([[file["#refs#/a"].ref]], dtype=h5py.ref_dtype)
    with pytest.raises(InputError, match=r"of DuoDIC or MultiDIC.*'Points3D_X'"):
        read_table(mat)
    mat.write_bytes(text(HEAD, *ROWS))
    with pytest.raises(InputError, match=r"seems to be text: rename it to end in \.csv"):
        read_table(mat)
    with h5py.File(h5, "w") as file:
        file["t"] = np.array([tuple(pair) for pair in PAIRS], dtype=[("strain", "f8"), ("stress", "f8")])
    np.testing.assert_array_equal(read_table(h5).values(Column("t/stress")), STRESS)
    with h5py.File(h5, "w") as file:
        for group in "ab":
            file[f"{group}/stress"] = STRESS
    with pytest.raises(InputError, match=r"'stress' is missing; the columns are '/a/stress', '/b/stress'"):
        read_table(h5).values(Column("stress"))
    np.testing.assert_array_equal(read_table(h5).values(Column("b/stress")), STRESS)
    with h5py.File(h5, "w") as file:
        file["stress"] = [str(one) for one in STRESS]
    with pytest.raises(InputError, match=r"holds no array of numbers, but /stress \(text\)"):
        read_table(h5)
    with h5py.File(h5, "w") as file:
        file["stress"] = np.where(STRESS == 5.0, np.nan, STRESS)
    with pytest.raises(InputError, match="entry 2: column '/stress' is not a finite number"):
        read_table(h5).values(Column("stress"))


def as_workbook(path: Path, columns: dict[str, np.ndarray]) -> Path:
    workbook(
        path / "a.xlsx",
        [list(columns), *(list(row) for row in zip(*map(np.ndarray.tolist, columns.values()), strict=True))],
    )
    return path / "a.xlsx"  # fmt: skip


def as_matlab(path: Path, columns: dict[str, np.ndarray]) -> Path:
    scipy.io.savemat(path / "a.mat", columns)
    return path / "a.mat"


def as_hdf5(path: Path, columns: dict[str, np.ndarray]) -> Path:
    with h5py.File(path / "a.h5", "w") as file:
        for name, values in columns.items():
            file[name] = values
    return path / "a.h5"


@pytest.mark.parametrize("write", [as_workbook, as_matlab, as_hdf5])
def test_every_door_for_a_table_takes_workbooks_and_arrays(write, tmp_path: Path) -> None:
    path = write(tmp_path, {"strain": STRAIN, "stress": STRESS})  # curves, slow tests, fields, marks
    np.testing.assert_allclose(read_table(path).values(Column("stress", 1e3)), 1e3 * STRESS, rtol=1e-14)
    read, _ = read_columns(path, {"s": WantedColumn("stress", "Pa", "kPa")})  # tests of a material
    np.testing.assert_allclose(read["s"], 1e3 * STRESS, rtol=1e-14)
    frames = {"frame": np.arange(12), "t": 10.0 * np.arange(12), "z": STRAIN}  # flyer, outline, surface
    found = read_frame_table(
        write(tmp_path, frames), frame=Column("frame"), time=Column("t", 1e-6), clock=True,
        columns={"z": Column("z", 1e-3)},
    )  # fmt: skip
    np.testing.assert_allclose(found.columns["z"], 1e-3 * STRAIN, rtol=1e-14)
    signal = np.sin(0.1 * np.arange(300))
    path = write(tmp_path, {"time": 1e-7 * np.arange(300), "volts": signal})  # force
    scope = read_scope(path, time=Column("time"), voltage=Column("volts"))
    np.testing.assert_allclose(scope.value, signal, atol=1e-15)
    recorded = read_recordings(path, ["volts"], layout=Layout(unit="V", time="time", time_unit="s"))
    np.testing.assert_allclose(recorded["volts"].value, signal, atol=1e-15)
