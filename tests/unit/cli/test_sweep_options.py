"""Designs from options of the command line: constraints, logarithmic parameters, workers."""

import csv
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from kolsky_command import json_of, rows_of, run_kolsky
from shot_folders import TINY

from doe.box import Constraint
from kolsky.base.apparatus import Interface
from kolsky.base.errors import InputError
from kolsky.cli.sweep import DesignChoice

NAMES = ("friction", "stiffness_factor")
POINTS = np.array([[0.0, 1.0], [1.0, 1.0], [2.0, 0.5], [0.5, 2.0]])


@pytest.mark.parametrize(
    ("text", "met"),
    [
        ("friction <= 2 * stiffness_factor - 1", [True, True, False, True]),
        ("friction * stiffness_factor < 1", [True, False, False, False]),
        ("0.5 <= friction < 2", [False, True, False, True]),
        ("1 / friction > 0", [False, True, True, True]),  # 1/0 is not finite and meets nothing
        ("-friction >= -(0.5 ** 2 + 0.25)", [True, False, False, True]),
    ],
)
def test_constraints_by_hand(text: str, met: list[bool]) -> None:
    assert Constraint(text, NAMES)(POINTS).tolist() == met


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("friction + 1", "no <= or >="), ("friction == 1", "only <, <=, > and >="),
        ("damping < 1", "damping is not varied; varied are friction"),
        ("friction.real < 1", "neither a number"), ("__import__('os') < 1", "neither a number"),
        ("friction < 'a'", "neither a number"), ("friction < True", "neither a number"),
        ("friction <", "cannot be read"), ("(" * 499 + "<", "cannot be read"),
        ("friction < 1" + " " * 500, "longer than 500"),
    ],
)  # fmt: skip
def test_what_is_no_constraint_is_refused(text: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        Constraint(text, NAMES)


BONDED, SLIDING = Interface("bonded", "bonded"), Interface("coulomb", "coulomb")


@pytest.mark.parametrize(
    ("choice", "interface", "wanted"),
    [
        (DesignChoice(), SLIDING, ()),  # friction and stiffness factor
        (DesignChoice(), BONDED, ("stiffness_factor=0.75:1.25:16",)),
        (DesignChoice(kind="sobol"), BONDED, ("stiffness_factor=0.75:1.25",)),
        (DesignChoice(vary=("friction=0:1:3",)), BONDED, ("friction=0:1:3",)),  # as asked for
    ],
)
def test_friction_is_not_varied_where_nothing_slides(
    choice: DesignChoice, interface: Interface, wanted: tuple[str, ...]
) -> None:
    assert choice.vary_of(interface) == wanted


def test_the_page_of_one_parameter_has_misfits_forces_and_cost(shot: Path) -> None:
    arguments = ["--vary", "stiffness_factor=0.9:1.2:4", "--figures", "csv"]
    said = json_of("sweep", shot, *TINY, *arguments)
    assert 0 < said["fewest_time_steps"] <= said["most_time_steps"]
    page = (shot / "results" / "sweep.html").read_text("utf-8")
    assert 'id="sweep-effects"' in page
    assert 'id="sweep-forces"' in page
    rows = rows_of(shot / "results" / "figures" / "sweep-forces.csv")
    one = [float(row["y"]) for row in rows if row["series"] == "$m$ = 0.9"]
    run_kolsky("simulate", shot, *TINY, "-p", "stiffness_factor=0.9")
    wanted = [
        float(row["simulated force (N)"]) for row in rows_of(shot / "results" / "simulation" / "force.csv")
    ]
    np.testing.assert_allclose(one, wanted, rtol=1e-5, atol=1e-6)  # digits of the tables


def test_points_that_break_a_constraint_are_left_out_and_counted() -> None:
    vary = ("friction=0:2:3", "stiffness_factor=0.5:1.5:3")
    design = DesignChoice(vary, where=("friction <= 1",)).design()
    assert len(design) == 6
    assert design.settings["refused"] == 3


def test_a_d_optimal_design_chooses_among_what_is_allowed() -> None:
    vary = ("friction=0:2", "stiffness_factor=0.5:1.5")
    design = DesignChoice(vary, "d-optimal", runs=8, where=("friction <= 1.2",)).design()
    assert len(design) == 8  # none is lost, as it would be if they were left out afterwards
    assert design.points[:, 0].max() == pytest.approx(1.0)  # the last of five levels of 0 to 2 below 1.2


def test_logarithmic_levels_have_equal_ratios() -> None:
    design = DesignChoice(("damping=1e-6:1e-4:3",), log=("damping",)).design()
    np.testing.assert_allclose(design.points[:, 0], [1e-6, 1e-5, 1e-4], rtol=1e-12)  # round-off


@pytest.mark.parametrize(
    ("choice", "words"),
    [
        (DesignChoice(("friction=0:2:3",), log=("friction",)), "needs a lower bound > 0"),
        (DesignChoice(("friction=0:2:3",), log=("damping",)), "names"),
        (DesignChoice(("friction=0:2:3",), where=("friction > 3",)), "no point of the 3"),
        (DesignChoice((), "csv", points=Path("x.csv"), log=("friction",)), "no effect on points"),
        (DesignChoice(("friction=0:2",), "lhs", generators="a b"), "need each other"),
    ],
)
def test_choices_that_cannot_be(choice: DesignChoice, words: str) -> None:
    with pytest.raises(InputError, match=words):
        choice.design()


def rows(folder: Path) -> list[list[str]]:
    with (folder / "results" / "sweep.csv").open(newline="") as file:
        return list(csv.reader(file))


@pytest.mark.slow
def test_a_sweep_through_processes_is_the_same_sweep(shot: Path) -> None:
    arguments = ["sweep", str(shot), *TINY, "--vary", "friction=0.1:0.6:3", "--where", "friction < 0.5"]
    arguments += ["--ledger", "none"]
    assert json_of(*arguments)["left_out_by_constraints"] == 1
    alone = rows(shot)
    # A process of its own: spawned workers import the main module.
    subprocess.run([sys.executable, "-m", "kolsky.cli", *arguments, "--processes", "2"], check=True)
    assert rows(shot) == alone
