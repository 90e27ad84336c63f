"""Files of earlier releases, and one description of every field."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from hdf5_contents import contents
from synthetic import synthetic

from dic.outcome import FrameOutcome, PointOutcome
from kolsky.base.hdf5 import Format, reading, writing
from kolsky.base.hdf5_records import RECORD_UNIT, Floats, Record
from kolsky.inverse.result import Estimate, Verdict
from kolsky.pictures.dic_file import read_stereo_result, stored_key, write_stereo_result
from kolsky.results.hdf5 import COMPARISON, ESTIMATE, read_identification, write_identification
from kolsky.results.nomenclature import factor_of

# Files of earlier releases are read, and written with the same contents.

DATA = Path(__file__).parents[2] / "data" / "results"
SENSITIVITY = ("/amount", "/moves/", "/visible", "/alike")
"""Of each declared input."""
INTERVAL = ("mesh_correction", "on_mesh", "correction", "budget", "route_difference")
NEW_IN_3 = ("fit", "clocks", "causes", *INTERVAL, *SENSITIVITY)
NEW_IN_4 = ("searched",)
NEW = {
    1: ("image_correlation", "numerical_parts", "variations", *NEW_IN_3, *NEW_IN_4),
    2: (*NEW_IN_3, *NEW_IN_4),
}
"""Groups that today's version has beside those of an earlier one."""


@pytest.mark.parametrize("version", [1, 2])
def test_an_identification_of_an_earlier_release(version: int) -> None:
    result = read_identification(DATA / f"identification-{version}.h5")
    assert result.shot == "made-up-01"
    estimate = result.estimates["stiffness_factor"]
    assert (estimate.name, estimate.unit, estimate.value) == ("stiffness_factor", "1", 1.12)
    assert (estimate.sigma_noise, estimate.sigma_numerical) == (0.0019, 0.0016)
    assert estimate.outcome is Verdict.IDENTIFIED
    assert estimate.numerical_parts == ({} if version == 1 else {"mesh": 0.00128, "roughness": 0.00096})
    assert result.estimates["damping"].unit == "s"
    assert result.fixed == {"poisson": 0.499, "friction": 0.5}
    assert len(result.variations) == (0 if version == 1 else 2)
    assert result.fit == ()
    assert result.clocks == ()
    assert result.causes == ()
    assert result.image_correlation == ({} if version == 1 else {"sigma_match_px": 0.011})
    assert result.profiles[1].name == "damping"
    assert result.posterior.samples.shape == (20, 4)
    assert result.methods[0].runs == 20
    assert result.response.nodes is not None
    assert result.provenance["seed"] == 1


@pytest.mark.parametrize("version", [1, 2])
def test_an_identification_written_again_holds_the_same(version: int, tmp_path: Path) -> None:
    old = DATA / f"identification-{version}.h5"
    write_identification(tmp_path / "again.h5", read_identification(old))
    before, after = contents(old), contents(tmp_path / "again.h5")
    # Written as today's version, whose further groups are empty.
    assert (before.pop("/")[0]["format_version"], after.pop("/")[0]["format_version"]) == (version, 4)
    after = {name: found for name, found in after.items() if not any(new in name for new in NEW[version])}
    assert after == before


def test_a_stereo_result_of_an_earlier_release(tmp_path: Path) -> None:
    old = DATA / "dic-2.h5"
    result = read_stereo_result(old)
    assert stored_key(old) is None  # `kolsky dic` makes it anew; what reads a result reads it
    assert result.axial_displacement is None or not result.axial_displacement.from_rim
    assert result.specimen.surface.n_frames == 9
    assert result.frames[0].tolist() == [0] * 7 + [int(FrameOutcome.BLACK), 0]
    assert result.rig.cameras[0].fx == 5400.0
    assert result.rig.cameras[1].sensor == (128, 128)
    assert result.rig.covariance is not None
    np.testing.assert_allclose(np.diag(result.rig.covariance), np.linspace(1.0, 2.0, 26), rtol=1e-15)
    assert all(isinstance(outcome, PointOutcome) for outcome in result.centre.left_out)
    assert [remark.name for remark in result.remarks] == ["wrong crop offset"]
    assert dict(result.seconds) == {"track": 1.25, "match": 0.5}
    write_stereo_result(tmp_path / "again.h5", result, key="abc")
    before, after = contents(old), contents(tmp_path / "again.h5")
    assert (before.pop("/")[0]["format_version"], after.pop("/")[0]["format_version"]) == (2, 3)
    # No frame of this file has a pose, and the covariance is of frames with one only.
    assert before.pop("/entry/motion/covariance")[2] == (9, 6, 9, 6)
    assert after.pop("/entry/motion/covariance")[2] == (0, 6, 0, 6)
    assert {name: found for name, found in after.items() if not name.endswith("from_rim")} == before


def test_a_verdict_of_earlier_words_is_read() -> None:
    assert Verdict("not told from a bound of the design") is Verdict.BOUND_REACHED
    assert Verdict("not told from another valley of the misfit") is Verdict.OTHER_VALLEY
    with pytest.raises(ValueError, match="not a valid Verdict"):
        Verdict("not told from anything")


# A field of a result has one description: HDF5, JSON, tables and display units use it.

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
