"""Units in which a summary writes its values."""

import pytest

from kolsky.shot.summary import Entry


@pytest.mark.parametrize(
    ("value", "unit", "written"),
    [
        (9.5e-3, "m", "9.5 mm"),
        (4e-6, "m", "4 um"),
        (-9.99e-5, "m", "-99.9 um"),
        (1e-4, "m", "0.1 mm"),
        (0.0, "m", "0 mm"),
        (25e-6, "s", "25 us"),
        (0.0999, "s", "99900 us"),
        (58.300025, "s", "58.300025000 s"),
        (870.0, "kg/m^3", "870 kg/m^3"),
        (3341, "", "3341"),
        ("bonded", "", "bonded"),
    ],
)
def test_a_length_below_a_tenth_of_a_millimetre_is_in_micrometres(
    value: float | str, unit: str, written: str
) -> None:
    assert Entry("a", "b", value, unit).written() == written
