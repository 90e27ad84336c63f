"""Texts and numbers of the command line."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from kolsky.base.errors import InputError
from kolsky.cli import texts
from kolsky.cli.plan import _frame_interval, _window
from kolsky.cli.sweep import DesignChoice, Records, Workers

# Texts of the command line: their meaning, and one-line error messages that name the expected input.


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


# Numbers of the command line: units, ends of ranges, parts and shares, all checked by hand.


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [("4 um", "m", 4e-6), ("0.2 um/N", "m/N", 2e-7), ("3.6 1/mm", "1/m", 3600.0), ("0.5 %", "1", 0.005)],
)
def test_quantities_come_out_in_si(text: str, unit: str, value: float) -> None:
    assert texts.physical("--option", text, unit) == pytest.approx(value, rel=1e-14)  # round-off of a factor


def test_a_positive_quantity_excludes_zero() -> None:
    assert texts.physical("--length", "0 mm", "m") == 0.0
    assert texts.physical("--length", "1 nm", "m", positive=True) == pytest.approx(1e-9)
    for text in ("0 mm", "-1 mm"):
        with pytest.raises(InputError, match=r"--length = .* is not allowed; it must be > 0 m"):
            texts.physical("--length", text, "m", positive=True)


def test_a_frame_rate_is_the_inverse_of_the_time_between_pictures() -> None:
    assert _frame_interval("--frame-rate", "125 kHz") == pytest.approx(8e-6, rel=1e-14)
    assert _window("--window", "50 us:1.2 ms") == pytest.approx((5e-5, 1.2e-3), rel=1e-14)
    with pytest.raises(InputError, match="must be > 0"):
        _frame_interval("--frame-rate", "0 kHz")


def test_strains_lie_between_zero_and_one_without_the_ends() -> None:
    assert texts.strains("--strains", "0.1, 0.999") == (0.1, 0.999)
    for text in ("0", "1", "0.2,1", "-0.1", "", "a"):
        with pytest.raises(InputError, match="numbers between 0 and 1"):
            texts.strains("--strains", text)


def test_the_edges_of_a_mesh_and_of_a_factorial() -> None:
    assert texts.mesh("--mesh", "2x2") == (2, 2)
    assert texts.mesh("--mesh", "1000x1000") == (1000, 1000)
    for text in ("1x2", "2x1", "1000x1001"):
        with pytest.raises(InputError, match="at most a million"):
            texts.mesh("--mesh", text)
    million = ["friction=0:2:1000", "poisson=0.1:0.4:1000"]
    assert texts.levels("--vary", million)[1] == [1000, 1000]
    with pytest.raises(InputError, match="1001000 runs"):
        texts.levels("--vary", ["friction=0:2:1001", "poisson=0.1:0.4:1000"])


def test_shards_are_counted_from_one_to_their_number() -> None:
    assert [texts.shard("--shard", text) for text in ("1/1", "1/3", "3/3")] == [(1, 1), (1, 3), (3, 3)]
    for text in ("0/3", "4/3", "3", "a/b", "1/0"):
        with pytest.raises(InputError, match="I from 1 to N"):
            texts.shard("--shard", text)


def test_parts_of_a_design_are_all_of_it_once() -> None:
    design = DesignChoice(("friction=0:2:7",)).design()
    parts = [Records(shard=(i, 3)).part(design).points[:, 0] for i in (1, 2, 3)]
    assert sorted(np.concatenate(parts)) == pytest.approx(np.linspace(0.0, 2.0, 7))
    assert Records(shard=(2, 3)).stem == "sweep-2of3"
    assert Records().stem == "sweep"


def test_cores_are_shared_out_among_processes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("kolsky.cli.sweep.cores", lambda: 12)
    assert Workers(4).threads(None) == 3
    assert Workers(5).threads(None) == 2  # none shares a core with another
    assert Workers(20).threads(None) == 1
    assert Workers(4).threads(7) == 7
    assert Workers().threads(None) is None


@dataclass
class Table:
    """What `least_misfit` reads of a `kolsky.inverse.run_table.DesignTable`."""

    phi_force: np.ndarray
    phi_shape: np.ndarray
    outcomes: tuple[str, ...] = ("COMPLETED", "COMPLETED", "COMPLETED")
    lost: tuple[int, ...] = ()
    names: tuple[str, ...] = ("friction",)
    points: np.ndarray = field(default_factory=lambda: np.array([[0.1], [0.2], [0.3]]))


def found(**values: object) -> dict[str, object]:
    from kolsky.studies.sweep import Sweep, counts, least_misfit

    result = Sweep("s", Table(**values), {})  # type: ignore[arg-type]
    return {**counts(result), **least_misfit(result)}


def test_the_best_run_of_a_sweep_by_hand() -> None:
    # Eq. (M.5) with 1000 N and 0.001: 3 + 0.5, 1 + 2, 2 + 1.5.
    force, shape = np.array([3000.0, 1000.0, 2000.0]), np.array([0.5e-3, 2e-3, 1.5e-3])
    best = found(phi_force=force, phi_shape=shape)
    assert best == {"runs": 3, "completed": 3, "smallest_phi": pytest.approx(3.0), "at": {"friction": 0.2}}
    shape[1] = 4e-3  # 1 + 4: now the first and the third tie, and the first stands first
    assert found(phi_force=force, phi_shape=shape)["at"] == {"friction": 0.1}


def test_the_best_run_without_an_outline_and_without_a_run() -> None:
    nothing = np.full(3, np.nan)
    by_force = found(phi_force=np.array([3000.0, np.nan, 2000.0]), phi_shape=nothing, lost=(1,))
    assert (by_force["completed"], by_force["smallest_phi"]) == (2, None)
    assert (by_force["smallest_phi_force"], by_force["at"]) == (2000.0, {"friction": 0.3})
    none = found(phi_force=nothing, phi_shape=nothing, lost=(0, 1, 2))
    assert none == {"runs": 3, "completed": 0, "smallest_phi": None, "at": None}


def test_a_name_cannot_steer_the_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    from kolsky.cli.terminal import print_result

    evil = "shot\x1b[2J\x1b]0;owned\x07\u202etxt"
    print_result({"shot": evil}, {}, files={"file": evil}, lines=[f"m of {evil}"], warnings=[f"{evil}!"])
    shown = "".join(capsys.readouterr())
    assert "owned" in shown
    assert not set(shown) & set("\x1b\x07\u202e")
