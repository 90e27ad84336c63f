"""A new parameter is one entry of `PARAMETERS`: it can be free, fixed, swept, planned, written and shown."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from module_files import module_at

import explicit
from doe import full_factorial
from kolsky.base.files import write_table
from kolsky.inverse.forward import Forward
from kolsky.inverse.parameters import (
    PARAMETERS,
    Parameter,
    any_slides,
    checked_value,
    design_box,
    has_effect,
    parameter,
    require_effect,
)
from kolsky.inverse.problem import prepare_shot
from kolsky.inverse.settings import Numerics
from kolsky.results.nomenclature import axis_label, in_words, name_of
from kolsky.shot.load import load_shot
from kolsky.studies.local_sensitivity import ObservationGrid, local_sensitivity
from kolsky.studies.sweep import columns, sweep

OPEN_01 = Path(__file__).parents[3] / "runs" / "open-01"

SOFTENING = Parameter(
    name="softening",
    words="softening of the specimen",
    symbol="s",
    written="s",
    tex="s",
    shown_unit="%",
    shown_factor=100.0,
    lower=0.0,
    upper=0.2,
    allowed=(0.0, 0.9),
    held=lambda shot: 0.0,
    enters=lambda fields, s: {
        **fields,
        "stiffness_factor": np.asarray(fields["stiffness_factor"]) * (1.0 - s),
    },
    scale=lambda value: 0.5,
)


class Asked(Exception):
    """Carries the samples that the solver was asked for."""


@pytest.fixture(autouse=True)
def made_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(PARAMETERS, "softening", SOFTENING)


@pytest.fixture(scope="module")
def forward() -> Forward:
    return prepare_shot(load_shot(OPEN_01)).forward


@pytest.fixture
def samples(monkeypatch: pytest.MonkeyPatch) -> Any:
    """The samples that a call asks the solver for, which does not run."""

    def asked(model: Any, samples: Any, *_: Any, **__: Any) -> None:
        raise Asked(samples)

    def of(call: Any) -> explicit.Samples:
        monkeypatch.setattr(explicit, "run", asked)
        with pytest.raises(Asked) as said:
            call()
        found: explicit.Samples = said.value.args[0]
        return found

    return of


def test_it_is_free_or_held(forward: Forward, samples: Any) -> None:
    box = design_box({"softening": None, "stiffness_factor": (1.0, 2.0)})
    assert (box.names, box.upper) == (("softening", "stiffness_factor"), (0.2, 2.0))
    points = {"softening": np.array([0.0, 0.1]), "stiffness_factor": np.array([1.0, 2.0])}
    free = samples(lambda: forward.run(points, Numerics()))
    np.testing.assert_allclose(free.stiffness_factor, [1.0, 1.8], rtol=1e-15)  # one rounding
    held = samples(lambda: forward.run({"softening": 0.5, "poisson": np.array([0.49, 0.495])}, Numerics()))
    np.testing.assert_allclose(held.stiffness_factor, [0.5, 0.5], rtol=1e-15)
    np.testing.assert_array_equal(held.poisson, [0.49, 0.495])


def test_without_it_the_samples_are_the_shots_own(forward: Forward, samples: Any) -> None:
    shot = forward.shot
    alone = samples(lambda: forward.run({}, Numerics()))
    declared = (1.0, shot.model.poisson, shot.model.damping, shot.interface.friction, shot.model.mass_damping)
    found = (alone.stiffness_factor, alone.poisson, alone.damping, alone.friction, alone.mass_damping)
    np.testing.assert_array_equal(np.ravel(found), declared)


def test_it_is_planned(forward: Forward, samples: Any) -> None:
    grid = ObservationGrid(np.linspace(0.0, 1e-3, 5), np.linspace(0.0, 1e-3, 3), np.array([1e-3, 2e-3]))
    asked = samples(lambda: local_sensitivity(forward, grid, ["softening"], reach=0.1))
    # Ten levels within 0.1 x 0.5 of the value 0, moved inwards, where less than none is not allowed.
    assert asked.stiffness_factor[0] == 1.0
    np.testing.assert_allclose(asked.stiffness_factor[[1, -1]], [1.0, 0.9], rtol=1e-12)


def test_it_is_swept_and_written(tmp_path: Path) -> None:
    shot = load_shot(OPEN_01)
    first = shot.window[0]
    short = replace(shot, window=(first, first + 0.3 * (shot.window[1] - first)))
    design = full_factorial(design_box({"softening": (0.0, 0.5)}), 2)
    made = sweep(short, design, numerics=Numerics(mesh=(4, 6), threads=1))
    table = write_table(tmp_path / "runs.csv", columns(made)).read_text("utf-8").splitlines()
    assert "softening (1)" in table[0]
    assert made.table.phi_force[0] != made.table.phi_force[1]


def test_pages_and_refusals_write_it_as_its_record_says() -> None:
    assert name_of("softening").factor == 100.0
    assert axis_label("softening") == "Softening of the specimen $s$ (%)"
    assert in_words("softening is not seen", ["softening"]) == "softening of the specimen s is not seen"
    with pytest.raises(ValueError, match=r"choose from stiffness_factor, .*, softening"):
        parameter("hardening")
    with pytest.raises(ValueError, match=r"softening = 1 is not allowed; it must be in \[0, 0.9\]"):
        checked_value("softening", 1.0)


def test_the_nomenclature_and_the_help_list_it() -> None:
    tables = module_at(OPEN_01.parents[1] / "docs" / "_ext" / "made_tables.py")
    rows = tables.parameters("kolsky").splitlines()
    assert rows[0] == "| $m$ | `stiffness_factor` | 1 | stiffness factor, dynamic over quasi-static modulus |"
    assert rows[-1] == "| $s$ | `softening` | 1 | softening of the specimen |"
    page = ["| a | b |\n<!-- parameters kolsky -->\nend"]
    tables.fill(None, "nomenclature", page)
    assert page[0].splitlines()[-2:] == [rows[-1], "end"]
    # A command's texts are made when its module is loaded: in a process of its own.
    code = (
        "from dataclasses import replace\nfrom kolsky.inverse.parameters import PARAMETERS as P\n"
        "P['softening'] = replace(P['damping'], name='softening')\n"
        "from kolsky.cli import main\nimport sys\nsys.argv = ['kolsky', 'identify', '--help']\nmain()"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "softening" in said.stdout


def test_what_a_contact_law_must_read(monkeypatch: pytest.MonkeyPatch) -> None:
    sticky = replace(SOFTENING, name="stickiness", read_by="carries_tension", without="nothing sticks")
    monkeypatch.setitem(PARAMETERS, "stickiness", sticky)
    assert has_effect(sticky, ["frictionless", "bonded"])
    assert not has_effect(sticky, ["coulomb", "a law of another version"])
    assert has_effect(SOFTENING, [])
    assert any_slides(["stickiness", "friction"])
    assert not any_slides(["stickiness", "release_stress"])
    require_effect(["stickiness"], "bonded", "frictionless")
    with pytest.raises(ValueError, match=r'choose the law "bonded" or "bonded_release" in its \[interface\]'):
        require_effect(["stickiness"], "rough", "rough")
    with pytest.raises(ValueError, match="stickiness has no effect together with friction"):
        require_effect(["friction", "stickiness"], "bonded", "bonded")
