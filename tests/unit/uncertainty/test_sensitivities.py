"""Sensitivities in texts and shares: amounts, the largest undeclared input, inputs without a residual."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from kolsky.inverse.result import Declaration
from kolsky.results.printed import printed_sensitivities, signed_percent
from kolsky.uncertainty.declarations import (
    UNDECLARED,
    amount_text,
    caution,
    elasticity,
    invisible_inputs,
    relative_moves,
)

ANSWER = {"stiffness_factor": 1.2, "damping": 0.0}


def part(key: str, amount: float, move: float, unit: str = "1", **more: Any) -> Declaration:
    made = Declaration(
        key, float("nan"), unit, {}, UNDECLARED, amount, {"stiffness_factor": move, "damping": 1e-7}, 0.5
    )
    return replace(made, **more)


LENGTH = part("specimen_length", 0.01, 0.024)
CLOCK = part("clock_offset", 1e-6, -0.036, "s")


def test_an_amount_has_its_unit() -> None:
    parts = (LENGTH, CLOCK, part("Z_offset", 1e-5, 0.0, "m"), part("poisson", 1e-5, 0.0))
    assert [amount_text(one) for one in parts] == ["1 %", "1 us", "10 um", "1e-05"]


def test_shares_are_of_the_answer_and_of_the_amount() -> None:
    # 0.024 of 1.2 is 2 %; d ln m / d ln length is 2 % over 1 %. A parameter at zero has no share.
    assert relative_moves(LENGTH, ANSWER) == pytest.approx({"stiffness_factor": 0.02})
    assert elasticity(LENGTH, ANSWER) == pytest.approx({"stiffness_factor": 2.0})
    assert elasticity(CLOCK, ANSWER) == {}
    assert signed_percent(0.0123) == "+1.2 %"


def test_rows_of_a_terminal_say_what_is_exact_and_what_leaves_no_residual() -> None:
    curve = part("curve_scale", 0.01, -0.012, visible=0.0009)
    estimates = {name: SimpleNamespace(value=value) for name, value in ANSWER.items()}
    declared = replace(CLOCK, status="varied")
    result: Any = SimpleNamespace(estimates=estimates, systematic=(LENGTH, curve, declared))
    assert printed_sensitivities(result, {"stiffness_factor": "m", "damping": "beta"}) == {
        "per 1 % of specimen_length": "m +2 % (taken as exact)",
        "per 1 % of curve_scale": "m -1 % (leaves no residual, taken as exact)",
        "per 1 us of clock_offset": "m -3 %",
    }


def test_the_caution_names_the_largest_that_is_undeclared() -> None:
    (said,) = caution((LENGTH, CLOCK), ANSWER)
    assert "[force] clock_offset" in said
    assert "1 us of it would change stiffness_factor by -3 %" in said
    assert "and so is one more" in said
    declared = replace(CLOCK, status="varied", sigma=1e-6)
    (said,) = caution((LENGTH, declared), ANSWER)
    assert "1 % of it would change stiffness_factor by +2 %; declare specimen_length" in said
    assert list(caution((declared,), ANSWER)) == []
    assert list(caution((), ANSWER)) == []


def test_what_leaves_no_residual_is_said_once() -> None:
    curve = part("curve_scale", 0.01, -0.012, visible=0.0009)
    density = part("specimen_density", 0.01, 0.012, visible=0.0011, alike=("sensitivity",))
    force = part("sensitivity", 0.01, 0.0, alike=("specimen_density",))
    first, second = invisible_inputs((curve, density, force))
    assert "the data show only m times the curve" in first
    assert "does not change the motion: a wrong specimen_density acts as a force gain" in second
    assert list(invisible_inputs((replace(curve, visible=float("nan")),))) == []
