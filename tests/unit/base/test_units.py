"""Quantities in text form, compared with values converted by hand."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kolsky.base import units
from kolsky.base.units import DIMENSIONS, USUAL, UnitError, quantity, unit_factor


@pytest.mark.parametrize(
    ("text", "unit", "expected"),
    [
        ("9.5 mm", "m", 9.5e-3), ("9.5mm", "m", 9.5e-3), (" 9.5  mm ", "m", 9.5e-3), ("1 in", "m", 0.0254),
        ("870 kg/m^3", "kg/m^3", 870.0), ("870 kg/m³", "kg/m^3", 870.0), ("0.87 g/cm^3", "kg/m^3", 870.0),
        ("25 us", "s", 2.5e-5), ("25 µs", "s", 2.5e-5), ("-200 us", "s", -2.0e-4), ("1.4e-3 s", "s", 1.4e-3),
        ("0.0112 V/N", "V/N", 0.0112), ("11.2 mV/N", "V/N", 0.0112), ("11.2 V/kN", "V/N", 0.0112),
        ("190 GPa", "Pa", 1.9e11), ("1 N/mm^2", "Pa", 1.0e6), ("500 mV", "V", 0.5), ("10 1/s", "1/s", 10.0),
        ("10 Hz", "1/s", 10.0), ("0.2 %", "1", 2.0e-3), ("9.5 mm^2/mm", "m", 9.5e-3),
        ("2 kg / m / s^2", "Pa", 2.0), ("0.002", "1", 2.0e-3),
    ],
)  # fmt: skip
def test_quantity_is_converted_to_si(text: str, unit: str, expected: float) -> None:
    assert quantity(text, unit) == pytest.approx(expected, rel=4e-16)  # two roundings of a double


def test_usual_units_have_the_factors_of_pint(monkeypatch: pytest.MonkeyPatch) -> None:
    usual = [(text, unit, factor) for unit, known in USUAL.items() for text, factor in known.items()]
    assert ("um", "m", 1e-6) in usual
    assert set(USUAL) <= set(DIMENSIONS)
    monkeypatch.setattr(units, "USUAL", {})
    for text, unit, factor in usual:
        assert unit_factor.__wrapped__(text, unit) == factor, (text, unit)


def test_powers_of_ten_round_once() -> None:
    # 25 * 1e-6 is 2.4999999999999998e-05; the nearest double to 25 us is the literal.
    assert quantity("25 us", "s") == 2.5e-5
    assert quantity("9.5 mm", "m") == 9.5e-3


@pytest.mark.parametrize(
    ("text", "unit", "fragments"),
    [
        ("9.5", "m", ["'9.5'", "has no unit", "a length", "'9.5 mm'"]),
        ("9.5 kg", "m", ["'9.5 kg'", "is a mass", "a length"]),
        ("9.5 A", "m", ["'9.5 A'", "is in A", "a length"]),
        ("9.5 us", "m", ["is a time", "expected a length"]),
        ("9,5 mm", "m", ["has the unit ',5 mm', which is not a unit"]),
        ("9.5 qq", "m", ["'qq'", "not a known unit"]), ("9.5 furlongs per", "m", ["has the unit"]),
        ("mm", "m", ["not a number with a unit"]), ("", "m", ["not a number with a unit"]),
        ("nan mm", "m", ["not a number with a unit"]), ("inf s", "s", ["not a number with a unit"]),
        ("1e400 s", "s", ["not a finite number"]), ("9**9**9**9 mm", "m", ["has the unit"]),
        ("9.5 m^9^9^9", "m", ["has the unit 'm^9^9^9', which is not a unit"]),
        ("1 qs^9 Hz^8 qs^9 Hz^9", "s", ["not a usable unit"]), ("9.5 m^(", "m", ["which is not a unit"]),
        ("9.5 __import__", "m", ["not a unit"]), ("870 kg/m^2", "kg/m^3", ["a mass density", "'870 kg/m^3'"]),
        ("20 degC", "1", ["is in"]),
    ],
)  # fmt: skip
def test_bad_quantity_names_text_dimension_and_example(text: str, unit: str, fragments: list[str]) -> None:
    with pytest.raises(UnitError) as caught:
        quantity(text, unit)
    for fragment in fragments:
        assert fragment in str(caught.value)


KGF, LBF, INCH = 9.80665, 0.45359237 * 9.80665, 0.0254
"""The kilogram-force and pound-force [N] and the inch [m] by definition."""


@pytest.mark.parametrize(
    ("written", "unit", "factor"),
    [
        *(
            (f"kgf{per}", "Pa", KGF / 1e-4)
            for per in ("/cm2", "/cm^2", "/cm²", " / cm2", "·cm⁻²", ".cm-2", "*cm^-2")
        ),
        *((f"N{per}", "Pa", 1e6) for per in ("/mm2", "/mm^2", "/mm²", " / mm²", "·mm⁻²", ".mm-2", "/mm**2")),
        *((f"kN{per}", "Pa", 1e3) for per in ("/m2", "/m^2", "/m²", " / m²", "·m⁻²", ".m-2")),
        *((text, "Pa", KGF / 1e-4) for text in ("kp/cm²", "KGF/cm2", "kp/cm2")),
        *((text, "Pa", LBF / INCH**2) for text in ("psi", "PSI", "Psi", "lbf/in2", "lbf/in²")),
        *((text, "Pa", 1e3 * LBF / INCH**2) for text in ("ksi", "KSI")),
        *((text, "Pa", 1e5) for text in ("bar", "Bar", "BAR")),
        *((text, "Pa", 1e6) for text in ("MPa", "MPA")),
        *((text, "N", KGF) for text in ("kgf", "Kgf", "KGF", "kp")),
        ("gf", "N", 1e-3 * KGF),
        *((text, "N", LBF) for text in ("lbf", "Lbf", "LBF")),
        ("KN", "N", 1e3),
        ("Newton", "N", 1.0),
        ("µε", "1", 1e-6),
        ("με", "1", 1e-6),
        *((text, "m^2", 1e-6) for text in ("mm2", "mm²", "mm^2")),
        ("in2", "m^2", INCH**2),
        ("g/cm3", "kg/m^3", 1e3),
        *((text, "1/s", 1.0) for text in ("s-1", "s⁻¹", "1/s")),
    ],
)
def test_units_as_testing_machines_print_them(written: str, unit: str, factor: float) -> None:
    assert unit_factor(written, unit) == pytest.approx(factor, rel=1e-12)  # round-off of a few products
    assert quantity(f"2.5 {written}", unit) == pytest.approx(2.5 * factor, rel=1e-12)


@pytest.mark.parametrize("written", ["mpa", "m2p", "cm2cm", "2m", "H2O", "cm22"])
def test_a_digit_or_capital_that_could_mean_two_things_is_refused(written: str) -> None:
    with pytest.raises(UnitError):
        unit_factor(written, "Pa")


@pytest.mark.parametrize("value", [9.5, 3, True, None, ["9.5 mm"]])
def test_a_value_that_is_no_text_has_no_unit(value: object) -> None:
    with pytest.raises(UnitError, match="has no unit"):
        quantity(value, "m")  # type: ignore[arg-type]


def test_unit_factor() -> None:
    assert unit_factor("mm", "m") == pytest.approx(1e-3, rel=1e-15)  # one rounding
    assert unit_factor("1", "1") == 1.0
    assert unit_factor("%", "1") == pytest.approx(0.01, rel=1e-15)  # one rounding
    with pytest.raises(UnitError, match="is a time"):
        unit_factor("s", "m")


LIKE_A_UNIT = st.text(alphabet="kmMgsPaNVudeB%°/^*() 13-+²", max_size=12).map("2 {}".format)


@settings(deadline=None, max_examples=200)  # the first example loads the unit registry
@given(st.text(max_size=30) | LIKE_A_UNIT, st.sampled_from(sorted(DIMENSIONS)))
def test_any_text_is_a_finite_number_or_a_unit_error(text: str, unit: str) -> None:
    try:
        value = quantity(text, unit)
    except UnitError:
        return
    assert math.isfinite(value)


@pytest.mark.parametrize("text", ["1e30 m", "-1e30 m", "1e-30 m", "0 m", "1e33 mm"])
def test_sizes_that_are_read(text: str) -> None:
    assert abs(quantity(text, "m")) in (0.0, pytest.approx(1e30, rel=1e-12), pytest.approx(1e-30, rel=1e-12))


@pytest.mark.parametrize("text", ["1.01e30 m", "-1e300 m", "0.99e-30 m", "1e-320 m", "1.01e33 mm"])
def test_sizes_that_nothing_measured_has(text: str) -> None:
    with pytest.raises(UnitError, match="has a size that nothing measured has; expected a length"):
        quantity(text, "m")


def test_plain_numbers_have_the_same_limit() -> None:
    from pydantic_core import PydanticCustomError

    from kolsky.schema.fields import number

    assert number(-1e30) == -1e30
    for value in (1.01e30, -1e300, float("inf"), 10**400):
        with pytest.raises(PydanticCustomError, match="is too large"):
            number(value)
