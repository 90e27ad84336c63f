"""Texts of the command line: what they mean, and that a refusal is one line that says what was expected."""

from collections.abc import Callable
from typing import Any

import pytest

from kolsky.base.errors import InputError
from kolsky.cli.work import options


def test_meshes() -> None:
    assert options.mesh("--mesh", "24x32") == (24, 32)
    assert options.mesh("--mesh", " 8 X 11 ") == (8, 11)


def test_values_are_si_or_carry_a_unit() -> None:
    found = options.values("-p", ["damping=25 us", "stiffness_factor=1.1", "mass_damping=0.05 1/ms"])
    # By hand: 25e-6 s and 0.05 / 1e-3 s; round-off of the factors.
    assert found == pytest.approx(
        {"damping": 25e-6, "stiffness_factor": 1.1, "mass_damping": 50.0}, rel=1e-14
    )
    assert options.values("-p", ["damping=2.5e-5"]) == {"damping": 2.5e-5}
    assert options.values("-p", ["friction=30 %"]) == pytest.approx({"friction": 0.3})


def test_ranges_levels_and_spans() -> None:
    assert options.ranges("--free", ["stiffness_factor", "damping=0:100 us"]) == {
        "stiffness_factor": None,
        "damping": (0.0, pytest.approx(1e-4)),
    }
    assert options.levels("--vary", ["friction=0:2:10", "damping=0 us:100 us:3"]) == (
        {"friction": (0.0, 2.0), "damping": (0.0, pytest.approx(1e-4))},
        [10, 3],
    )
    assert options.spans("--vary", ["friction=0:2"]) == {"friction": (0.0, 2.0)}


REFUSED: dict[str, tuple[Callable[[str, Any], object], Any, str]] = {
    "no mesh": (options.mesh, "24", "elements across the radius"),
    "mesh of letters": (options.mesh, "axb", "elements across the radius"),
    "negative mesh": (options.mesh, "-8x11", "elements across the radius"),
    "superscript mesh": (options.mesh, "²x3", "elements across the radius"),
    "tiny mesh": (options.mesh, "1x9", "at least 2x2"),
    "huge mesh": (options.mesh, "9999x9999", "at most a million"),
    "no equals": (options.values, ["friction"], "NAME=VALUE"),
    "unknown": (options.values, ["stifness=1"], "there is no parameter 'stifness'; choose from stiffness_f"),
    "twice": (options.values, ["friction=1", "friction=2"], "friction once"),
    "no number": (options.values, ["friction=much"], "'friction=much'"),
    "wrong unit": (options.values, ["damping=25 mm"], "'damping=25 mm'"),
    "outside": (options.values, ["poisson=0.5"], "must be in [0, 0.4999]"),
    "not a number": (options.values, ["friction=nan"], "must be in [0, 1000]"),
    "one bound": (options.ranges, ["friction=1"], "NAME or NAME=LOW:HIGH"),
    "three bounds": (options.ranges, ["friction=0:1:2"], "NAME or NAME=LOW:HIGH"),
    "reversed": (options.ranges, ["friction=2:1"], "lower bound of friction before the upper"),
    "equal": (options.ranges, ["friction=1:1"], "lower bound of friction before the upper"),
    "bound outside": (options.ranges, ["poisson=0.4:0.5"], "must be in [0, 0.4999]"),
    "unknown free": (options.ranges, ["m"], "there is no parameter 'm'"),
    "free twice": (options.ranges, ["friction", "friction=0:1"], "friction once"),
    "no levels": (options.levels, ["friction=0:2"], "NAME=LOW:HIGH:LEVELS"),
    "one level": (options.levels, ["friction=0:2:1"], "at least 2 levels"),
    "broken levels": (options.levels, ["friction=0:2:many"], "at least 2 levels"),
    "reversed levels": (options.levels, ["friction=2:0:5"], "lower bound"),
    "too many runs": (options.levels, ["friction=0:2:2000", "poisson=0:0.4:2000"], "4000000 runs"),
    "levels without a factorial": (options.spans, ["friction=0:2:5"], "NAME=LOW:HIGH"),
    "span without bounds": (options.spans, ["friction"], "NAME=LOW:HIGH"),
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
    assert options.one_of("--precision", "fp32", ("fp64", "fp32")) == "fp32"
    with pytest.raises(InputError, match='--precision = "fp16" is not known; it must be fp64 or fp32'):
        options.one_of("--precision", "fp16", ("fp64", "fp32"))
    options.finer("--refined-mesh", (16, 22), "--mesh", (8, 11))
    for coarse in ((8, 22), (16, 11), (8, 11)):
        with pytest.raises(InputError, match="is not finer than --mesh 8x11 in both directions"):
            options.finer("--refined-mesh", coarse, "--mesh", (8, 11))
    options.apart("--free", ["friction"], "--parameter", ["poisson"])
    with pytest.raises(InputError, match="friction is named by both --free and --parameter"):
        options.apart("--free", ["friction"], "--parameter", ["friction"])
