"""Likely causes of a misfit in the report, the terminal, JSON and the HDF5 file."""

from dataclasses import replace
from pathlib import Path

from synthetic import synthetic

from kolsky.inverse.result import CauseFinding, Identification
from kolsky.report.pages.identification import cause_table
from kolsky.results.hdf5 import read_identification, write_identification
from kolsky.results.printed import details
from kolsky.results.tables import to_json

LATE = CauseFinding(
    key="flyer.time", words="a lag of the flyer's record", unit="s", exact=0.0, value=2.013e-5, sigma=1.4e-7,
    explained=0.982, evidence=1066.6, probability=1e-30, parameters={"stiffness_factor": 1.1267},
    sigmas={"stiffness_factor": 0.0013}, named=True, alike=("centre_line.time",),
    solved={"stiffness_factor": 1.1204}, solved_sigmas={"stiffness_factor": 0.0021},
)  # fmt: skip
LENGTH = replace(
    LATE, key="specimen.length", words="a factor on the specimen's length", unit="1", exact=1.0, value=1.0012,
    sigma=0.0004, explained=-0.1, probability=0.31, named=False, alike=(), solved={}, solved_sigmas={},
    declared_sigma=0.001,
)  # fmt: skip


def made() -> Identification:
    return replace(synthetic(), causes=(LATE, LENGTH))


def test_a_row_has_value_share_chance_answer_and_what_to_do() -> None:
    table = cause_table(made())
    (row,), (other,) = table["named"], table["others"]
    assert (row["within"], other["within"]) == (False, True)
    assert (row["value"], row["declared"], row["explained"]) == ("20.13 ± 0.28 µs", "0 µs", "98 %")
    assert (row["probability"], other["probability"]) == ("< 0.0001", "0.31")
    assert row["answers"] == ["1.1267"]
    assert row["solved"] == ["1.1204 ± 0.0042"]
    assert row["check"].startswith("check the times")
    assert row["alike"] == "centre_line.time"
    assert (other["value"], other["explained"]) == ("1.00120 ± 0.00080", "−10 %")
    assert (table["tried"], table["solved"]) == (2, True)
    assert "quasi-static curve" in table["invisible"][0]


def test_the_terminal_lists_likely_causes_alone() -> None:
    rows = details(made())
    assert rows["likely cause 1, flyer.time"] == (
        "a lag of the flyer's record of 20.13 ± 0.28 us (k = 2) explains 98.2 %; "
        "m = 1.1204 identified with it"
    )
    assert not [name for name in rows if "specimen.length" in name and "cause" in name]


def test_json_and_file_hold_every_field(tmp_path: Path) -> None:
    found = made()
    first = to_json(found)["causes"][0]
    assert (first["key"], first["named"], first["change"]) == ("flyer.time", True, 2.013e-5)
    write_identification(tmp_path / "one.h5", found)
    assert read_identification(tmp_path / "one.h5").causes == found.causes
