"""Numbers as text: rounding by the uncertainty, significant digits, percentages, terminal characters."""

import pytest
from markupsafe import Markup

from kolsky.results import numbers
from kolsky.results import numbers as plain_text
from kolsky.results.nomenclature import typeset, upper_first, with_subscripts


@pytest.mark.parametrize(
    ("value", "uncertainty", "expected"),
    [
        (1.1200412, 0.0049678, ("1.1200", "0.0050")),
        (1.12, 0.00996, ("1.120", "0.010")),
        (1.12, 0.0994, ("1.120", "0.099")),
        (57432.1, 1234.0, ("57400", "1200")),
        (-0.012, 0.034, ("−0.012", "0.034")),
        (-0.0001, 0.034, ("0.000", "0.034")),
        (2.5e-5, 1.3e-6, ("2.50 × 10⁻⁵", "0.13 × 10⁻⁵")),
        (4.0, 2.6e-8, ("4.000000000", "0.000000026")),  # no "× 10⁰"
        (1.23456, 0.0, ("1.235", "0")),
        (1.23456, float("inf"), ("1.235", "–")),
        (float("nan"), float("nan"), ("–", "–")),
    ],
)
def test_numbers_are_rounded_by_their_uncertainty(
    value: float, uncertainty: float, expected: tuple[str, str]
) -> None:
    assert numbers.measured(value, uncertainty) == expected


@pytest.mark.parametrize(
    ("value", "digits", "expected"),
    [
        (0.0, 4, "0"), (0.499, 4, "0.499"), (2.5e-5, 4, "2.5 × 10⁻⁵"), (123456.7, 4, "123500"),
        (1234567.0, 4, "1.235 × 10⁶"), (-9.9996, 4, "−10"), (0.0010, 2, "0.001"),
    ],
)  # fmt: skip
def test_plain_numbers(value: float, digits: int, expected: str) -> None:
    assert numbers.plain(value, digits) == expected


@pytest.mark.parametrize(
    ("value", "whole", "expected"),
    [
        (0.00171, 0.0038, "0.00171"),  # the whole is rounded to 0.0001, a part to 0.00001
        (0.0123, 0.13, "0.012"),
        (1.25, 26.0, "1.2"),  # half to even, as `round` does
        (3.0, float("nan"), "3"),
        (0.5, 0.0, "0.5"),
    ],
)
def test_a_part_has_one_digit_more_than_the_whole(value: float, whole: float, expected: str) -> None:
    assert numbers.part(value, whole) == expected


@pytest.mark.parametrize(
    ("share", "digits", "expected"),
    [(0.25, 2, "25 %"), (0.053254, 2, "5.3 %"), (1.0, 2, "100 %"), (0.0, 2, "0 %"), (float("nan"), 2, "–")],
)
def test_percentages(share: float, digits: int, expected: str) -> None:
    assert numbers.percent(share, digits) == expected


@pytest.mark.parametrize(
    ("value", "last", "expected"),
    [
        (1234.5, 1, "1230"),
        (1234.5, -1, "1234.5"),
        (-0.04, -1, "0.0"),
        (-0.06, -1, "−0.1"),
        (float("inf"), 0, "–"),
    ],
)
def test_rounding_at_a_power_of_ten(value: float, last: int, expected: str) -> None:
    assert numbers.rounded(value, last) == expected


def test_a_terminal_gets_plain_characters() -> None:
    assert plain_text.plain_sentence("−2.50 × 10⁻⁵ µs") == "-2.50e-5 us"
    assert plain_text.plain_sentence(numbers.NOTHING) == "unknown"


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


def test_rows_of_a_page_are_lines_of_a_terminal() -> None:
    rows = [
        {"Shot": "a", Markup("<i>U</i>"): "1.10", "Lag (µs)": "−2", "lost": True},
        {"Shot": "long", Markup("<i>U</i>"): "1.2", "Lag (µs)": ""},
    ]
    assert numbers.table_lines(rows) == ["Shot  U     Lag (µs)", "a     1.10  −2", "long  1.2"]
    assert numbers.row_lines(rows) == {"a": "U 1.10, lag (us) -2", "long": "U 1.2"}
    assert numbers.row_lines(rows, 2) == {"a, 1.10": "lag (us) -2", "long, 1.2": ""}
