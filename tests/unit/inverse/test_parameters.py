"""The parameters by name: their values in a shot, their ranges, the box of a design."""

from dataclasses import fields
from pathlib import Path

import pytest

from explicit import Samples
from kolsky.inverse.parameters import PARAMETERS, checked_value, design_box, parameter
from kolsky.shot.load import load_shot

OPEN_01 = Path(__file__).parents[3] / "runs" / "open-01"


def test_every_parameter_is_one_of_the_solver_and_has_the_shots_value() -> None:
    shot = load_shot(OPEN_01)
    own = {name: p for name, p in PARAMETERS.items() if p.belongs_to(shot)}
    assert set(own) <= {f.name for f in fields(Samples)}
    declared = {name: p.held(shot) for name, p in own.items()}
    # As written in its shot.toml; m is 1 by the meaning of the quasi-static curve.
    assert declared == pytest.approx(
        {
            "stiffness_factor": 1.0,
            "friction": 0.0,
            "poisson": 0.499,
            "damping": 25e-6,
            "mass_damping": 0.0,
            "release_stress": 0.0,
        }
    )


@pytest.mark.parametrize("name", PARAMETERS)
def test_default_bounds_are_allowed(name: str) -> None:
    p = PARAMETERS[name]
    assert p.name == name
    assert p.allowed[0] <= p.lower < p.upper <= p.allowed[1]
    for end in p.allowed:
        assert checked_value(name, end) == end
    box = design_box({name: None})
    assert (box.names, box.lower, box.upper) == ((name,), (p.lower,), (p.upper,))


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("poisson", 0.5, r"poisson = 0.5 is not allowed; it must be in \[0, 0.4999\]"),
        ("damping", -1e-6, r"damping = -1e-06 s is not allowed; it must be in \[0, 0.01\] s"),
        ("stiffness_factor", float("nan"), "stiffness_factor = nan is not allowed"),
        ("friction", float("inf"), "friction = inf is not allowed"),
    ],
)
def test_values_outside_are_refused(name: str, value: float, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        checked_value(name, value)
    with pytest.raises(ValueError, match=words):
        design_box({name: (PARAMETERS[name].lower, value)})


def test_unknown_names_and_reversed_bounds_are_refused() -> None:
    with pytest.raises(ValueError, match="no parameter 'm'; choose from stiffness_factor, friction, poisson"):
        parameter("m")
    with pytest.raises(ValueError, match="lower bound 2 must be below the upper bound 1"):
        design_box({"friction": (2.0, 1.0)})


def test_a_box_keeps_the_order_of_the_names() -> None:
    box = design_box({"friction": (0.0, 1.0), "stiffness_factor": None})
    assert box.names == ("friction", "stiffness_factor")
    assert box.upper == (1.0, 2.5)
