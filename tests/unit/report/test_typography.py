"""Text of a terminal as a page sets it, and what must stay as it is."""

import pytest

from kolsky.results.nomenclature import typeset, upper_first, with_subscripts


@pytest.mark.parametrize(
    ("written", "wanted"),
    [
        ("lag +0.57 us +- 1.24 us", "lag +0.57 µs ± 1.24 µs"),
        ("1.024e+05 m/s^2", "1.024 × 10⁵ m/s²"),
        ("-3.9e-06 %", "−3.9 × 10⁻⁶ %"),
        ("870 kg/m^3, -200 us", "870 kg/m³, −200 µs"),
        ("4 um of open-01.csv, axis Z-1", "4 µm of open-01.csv, axis Z-1"),
        ("sha 2d95e14b 12e45", "sha 2d95e14b 12e45"),
        ("a menu in use", "a menu in use"),
    ],
)
def test_signs_powers_and_units_are_set_and_names_stay(written: str, wanted: str) -> None:
    assert typeset(written) == wanted


def test_only_a_single_letter_has_a_subscript_and_text_is_escaped() -> None:
    assert with_subscripts("Φ_F and σ_b <") == "Φ<sub>F</sub> and σ<sub>b</sub> &lt;"
    assert with_subscripts("clock_offset, Z_offset, a_") == "clock_offset, Z_offset, a_"


def test_the_rest_of_a_sentence_keeps_its_case() -> None:
    assert upper_first("the CSV file") == "The CSV file"
    assert upper_first("") == ""
