"""A field of a result has one description: HDF5, JSON, tables and display units use it."""

from dataclasses import dataclass, replace
from pathlib import Path

import pytest
from synthetic import synthetic

from kolsky.base.hdf5 import Format, reading, writing
from kolsky.base.hdf5_records import RECORD_UNIT, Floats, Record
from kolsky.inverse.result import Estimate
from kolsky.results.hdf5 import COMPARISON, ESTIMATE
from kolsky.results.nomenclature import factor_of

FORMAT = Format("a test", version=4, readable=(4,))


@dataclass(frozen=True)
class Widened(Estimate):
    """An estimate with a field more."""

    bias: float = 0.25
    """In the unit of the estimate."""


WIDENED = Record(
    Widened,
    ESTIMATE.group,
    {**ESTIMATE.fields, "bias": Floats(RECORD_UNIT, heading="bias", parameter="name")},
)


def widened() -> Widened:
    """An estimate of the damping, in SI."""
    return Widened(**vars(synthetic(("damping",)).estimates["damping"]))


def test_a_new_field_takes_one_entry(tmp_path: Path) -> None:
    made = widened()
    with writing(tmp_path / "made.h5", FORMAT) as place:
        WIDENED.write(replace(place, path="damping"), made)
    with reading(tmp_path / "made.h5", FORMAT, cure="none") as place:
        back = WIDENED.read(replace(place, path="damping"))
    assert back == made
    assert WIDENED.json(made)["bias"] == 0.25
    assert WIDENED.columns([made, made])["bias"] == [0.25, 0.25]
    assert WIDENED.scaled(made, factor_of).bias == 0.25 * factor_of("damping") != 0.25


def test_a_field_without_an_entry_is_refused() -> None:
    with pytest.raises(TypeError, match="fields of Widened and of its table differ: bias"):
        Record(Widened, ESTIMATE.group, ESTIMATE.fields)


def test_keys_and_headings_leave_out_what_they_are_told_to() -> None:
    said, columns = ESTIMATE.json(widened()), ESTIMATE.columns([widened()])
    assert "name" not in said
    assert list(columns)[:4] == ["parameter", "unit", "value", "sigma"]
    assert columns["lower (k = 2)"] == [said["interval"][0]]


def test_a_table_has_the_fields_along_one_dimension() -> None:
    made = synthetic().comparison
    force, profile = COMPARISON.table(made, "bins"), COMPARISON.table(made, "points")
    assert list(force) == ["time (s)", "measured force (N)", "sigma (N)", "simulated force (N)"]
    assert set(profile["inside (0/1)"]) <= {0, 1}
    assert len(profile["Z measured (m)"]) == len(profile["time (s)"]) == len(made.Z_model)
