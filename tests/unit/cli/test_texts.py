"""Texts of the command line: their meaning, and one-line error messages that name the expected input."""

from collections.abc import Callable
from typing import Any

import pytest

from kolsky.base.errors import InputError
from kolsky.cli import texts


def test_meshes() -> None:
    assert texts.mesh("--mesh", "24x32") == (24, 32)
    assert texts.mesh("--mesh", " 8 X 11 ") == (8, 11)


def test_values_are_si_or_carry_a_unit() -> None:
    found = texts.values("-p", ["damping=25 us", "stiffness_factor=1.1", "mass_damping=0.05 1/ms"])
    # By hand: 25e-6 s and 0.05 / 1e-3 s; round-off of the factors.
    assert found == pytest.approx(
        {"damping": 25e-6, "stiffness_factor": 1.1, "mass_damping": 50.0}, rel=1e-14
    )
    assert texts.values("-p", ["damping=2.5e-5"]) == {"damping": 2.5e-5}
    assert texts.values("-p", ["friction=30 %"]) == pytest.approx({"friction": 0.3})


def test_what_is_held_at_the_shots_value_and_at_another() -> None:
    assert texts.holds("--hold", ["poisson", "damping=25 us"]) == ({"damping": 25e-6}, ("poisson",))
    assert texts.holds("--hold", ["poisson=incompressible"])[0] == {"poisson": 0.49998}
    with pytest.raises(InputError, match="damping=incompressible"):
        texts.holds("--hold", ["damping=incompressible"])
    for twice in (["poisson", "poisson"], ["poisson=0.49", "poisson"]):
        with pytest.raises(InputError, match="poisson once"):
            texts.holds("--hold", twice)
    with pytest.raises(InputError, match="there is no parameter 'nu'"):
        texts.holds("--hold", ["nu"])


def test_ranges_levels_and_spans() -> None:
    assert texts.ranges("--free", ["stiffness_factor", "damping=0:100 us"]) == {
        "stiffness_factor": None,
        "damping": (0.0, pytest.approx(1e-4)),
    }
    assert texts.levels("--vary", ["friction=0:2:10", "damping=0 us:100 us:3"]) == (
        {"friction": (0.0, 2.0), "damping": (0.0, pytest.approx(1e-4))},
        [10, 3],
    )
    assert texts.spans("--vary", ["friction=0:2"]) == {"friction": (0.0, 2.0)}


REFUSED: dict[str, tuple[Callable[[str, Any], object], Any, str]] = {
    "no mesh": (texts.mesh, "24", "elements across the radius"),
    "mesh of letters": (texts.mesh, "axb", "elements across the radius"),
    "negative mesh": (texts.mesh, "-8x11", "elements across the radius"),
    "superscript mesh": (texts.mesh, "²x3", "elements across the radius"),
    "tiny mesh": (texts.mesh, "1x9", "at least 2x2"),
    "huge mesh": (texts.mesh, "9999x9999", "at most a million"),
    "no equals": (texts.values, ["friction"], "NAME=VALUE"),
    "unknown": (texts.values, ["stifness=1"], "there is no parameter 'stifness'; choose from stiffness_f"),
    "twice": (texts.values, ["friction=1", "friction=2"], "friction once"),
    "no number": (texts.values, ["friction=much"], "'friction=much'"),
    "wrong unit": (texts.values, ["damping=25 mm"], "'damping=25 mm'"),
    "outside": (texts.values, ["poisson=0.5"], "must be in [0, 0.49999]"),
    "not a number": (texts.values, ["friction=nan"], "must be in [0, 1000]"),
    "one bound": (texts.ranges, ["friction=1"], "NAME or NAME=LOW:HIGH"),
    "three bounds": (texts.ranges, ["friction=0:1:2"], "NAME or NAME=LOW:HIGH"),
    "reversed": (texts.ranges, ["friction=2:1"], "lower bound of friction before the upper"),
    "equal": (texts.ranges, ["friction=1:1"], "lower bound of friction before the upper"),
    "bound outside": (texts.ranges, ["poisson=0.4:0.5"], "must be in [0, 0.49999]"),
    "unknown free": (texts.ranges, ["m"], "there is no parameter 'm'"),
    "free twice": (texts.ranges, ["friction", "friction=0:1"], "friction once"),
    "no levels": (texts.levels, ["friction=0:2"], "NAME=LOW:HIGH:LEVELS"),
    "one level": (texts.levels, ["friction=0:2:1"], "at least 2 levels"),
    "broken levels": (texts.levels, ["friction=0:2:many"], "at least 2 levels"),
    "reversed levels": (texts.levels, ["friction=2:0:5"], "lower bound"),
    "too many runs": (texts.levels, ["friction=0:2:2000", "poisson=0:0.4:2000"], "4000000 runs"),
    "levels without a factorial": (texts.spans, ["friction=0:2:5"], "NAME=LOW:HIGH"),
    "span without bounds": (texts.spans, ["friction"], "NAME=LOW:HIGH"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refusals_are_one_line(case: str) -> None:
    parse, text, words = REFUSED[case]
    with pytest.raises(InputError) as caught:
        parse("--option", text)
    message = str(caught.value)
    assert message.startswith("command line: ")
    assert "--option" in message
    assert words in message
    assert "\n" not in message


def test_choices_and_clashes() -> None:
    assert texts.one_of("--precision", "fp32", ("fp64", "fp32")) == "fp32"
    with pytest.raises(InputError, match='--precision = "fp16" is not known; it must be fp64 or fp32'):
        texts.one_of("--precision", "fp16", ("fp64", "fp32"))
    texts.finer("--refined-mesh", (16, 22), "--mesh", (8, 11))
    for coarse in ((8, 22), (16, 11), (8, 11)):
        with pytest.raises(InputError, match="is not finer than --mesh 8x11 in both directions"):
            texts.finer("--refined-mesh", coarse, "--mesh", (8, 11))
    texts.apart("--free", ["friction"], "--parameter", ["poisson"])
    with pytest.raises(InputError, match="friction is named by both --free and --parameter"):
        texts.apart("--free", ["friction"], "--parameter", ["friction"])
