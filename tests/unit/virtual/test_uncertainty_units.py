"""The table [uncertainty] of a made shot: every value with its unit."""

from kolsky.schema.apparatus import UncertaintySection
from kolsky.virtual.shot_file import _uncertainty


def test_lengths_have_metres_and_shares_none() -> None:
    given = {"length_in_pictures": 2e-6, "y_offset": 1e-6, "specimen_length": 1e-3, "poisson": 3e-4}
    written = _uncertainty(given)
    assert written == {
        "length_in_pictures": "2e-06 m",
        "y_offset": "1e-06 m",
        "specimen_length": "0.001",
        "poisson": 3e-4,
    }
    read = UncertaintySection.model_validate(written)
    assert read.length_in_pictures == 2e-6
    assert "length_in_pictures" not in read.for_identify()
    assert "length_in_pictures" not in read.for_waves()
