"""The solver's registries: a law, a contact law and an element of one file each work everywhere."""

import inspect
import re
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import test_contact_laws as contact_battery
import test_material_laws as law_battery
from module_files import module_at
from test_material_laws import apart, impact

from explicit import Response, Samples
from explicit.contact import CONTACT_LAWS
from explicit.elements import ELEMENTS
from explicit.materials import LAWS
from explicit.materials.families import InvariantLaw
from explicit.materials.laws.polynomial import MooneyRivlin
from explicit.precision import PRECISIONS
from kolsky.bodies.specimen_constants import constants_of
from kolsky.material.fits.compare import candidates
from kolsky.material.fits.fit import fit_law
from kolsky.material.fits.homogeneous import Mode, incompressible_stress
from kolsky.material.fits.homogeneous_test import HomogeneousTest
from kolsky.schema.material import LawSection

DOCS = Path(__file__).parents[3] / "docs"
(KNOWLES,) = re.findall(
    r"^```python\n(.*?)^```$", (DOCS / "tour.md").read_text("utf-8"), re.DOTALL | re.MULTILINE
)
"""The law that the tour writes out."""
TACKY = '''
"""Tacky: sticks while pressed, pulls up to a stress, and sticks again when pressed again."""

import warp as wp

from explicit.contact.base import TOUCHED, touch_struct


class Tacky:
    name = "tacky"
    needs_friction = False
    needs_release_stress = True
    needs_stiffness = False
    carries_tension = True
    slides = False
    remembers_slip = False

    def kernel_function(self, precision):
        real, vec2 = precision.real, precision.vec2
        Touch = touch_struct(precision)
        zero, touched = real(0.0), int(TOUCHED)

        @wp.func
        def tacky(touch: Touch):
            velocity = vec2(touch.v_r, touch.v_y)
            away = touch.normal * (touch.v_y - touch.target)
            holds = touch.status == touched and touch.density * away / touch.interval < touch.release_stress
            if away < zero or holds:
                velocity = vec2(zero, touch.target)
            return velocity, touch.status, touch.slip

        return tacky
'''
TWIN = '''
"""An element by another name."""

from dataclasses import dataclass

from explicit.elements.fbar import FBar


@dataclass(frozen=True)
class Twin(FBar):
    name: str = "twin"
'''


TABLES = DOCS / "_ext" / "made_tables.py"


def module_of(source: str, folder: Path, name: str, *, write: bool = True) -> ModuleType:
    """A source as a module in a file, which the translator reads."""
    file = folder / f"{name}.py"
    if write:
        file.write_text(source, "utf-8")
    return module_at(file)


@pytest.fixture(scope="module")
def members(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """The made-up law, contact law and element, in their registries."""
    folder = tmp_path_factory.mktemp("doors")
    law = module_of(KNOWLES, folder, "door_knowles").Knowles
    contact = module_of(TACKY, folder, "door_tacky").Tacky()
    element = module_of(TWIN, folder, "door_twin").Twin()
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(LAWS, law.NAME, law)
        patch.setitem(CONTACT_LAWS, contact.name, contact)
        patch.setitem(ELEMENTS, element.name, element)
        yield law, contact, element
    for name in ("door_knowles", "door_tacky", "door_twin"):
        del sys.modules[name]


def battery(module: ModuleType, parameter: str) -> list[Callable[..., None]]:
    """The tests of a module that go over a registry: those that take the member alone."""
    found = [f for name, f in vars(module).items() if name.startswith("test_")]
    return [f for f in found if [*inspect.signature(f).parameters] == [parameter]]


LAW_BATTERY = battery(law_battery, "law")
CONTACT_BATTERY = battery(contact_battery, "name")


def test_the_batteries_are_there() -> None:
    assert len(LAW_BATTERY) >= 8
    assert len(CONTACT_BATTERY) >= 6


@pytest.mark.parametrize("check", LAW_BATTERY, ids=lambda f: f.__name__)
def test_a_material_law_gets_the_battery(members: Any, check: Callable[..., None]) -> None:
    check(members[0].example())


@pytest.mark.parametrize("check", CONTACT_BATTERY, ids=lambda f: f.__name__)
def test_a_contact_law_gets_the_battery(members: Any, check: Callable[..., None]) -> None:
    check(members[1].name)


def test_the_second_invariant_is_found_in_the_law() -> None:
    """A law does not say that it depends on I2_bar: its kernels follow from its energy."""
    both = {
        name for name, law in LAWS.items() if issubclass(law, InvariantLaw) and law.uses_second_invariant()
    }
    assert both == {"mooney_rivlin", "polynomial", "veronda_westmann"}

    class Dormant(MooneyRivlin):
        """Its example has no share of I2_bar."""

        PARAMETERS = tuple(replace(s, example=0.0) if s.name != "C10" else s for s in MooneyRivlin.PARAMETERS)

    assert Dormant.example().constants()[1] == 0.0
    assert Dormant.uses_second_invariant()


@pytest.mark.parametrize(
    ("precision", "mapping"), [("fp64", "simulation"), ("fp32", "worker"), ("fp64", None)]
)
def test_its_warp_functions_are_its_twin(
    members: Any, precision: str, mapping: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    law = members[0]
    monkeypatch.setattr(law_battery, "LAWS", {law.NAME: law})
    monkeypatch.setattr(law_battery, "EXAMPLES", [law.example()])
    monkeypatch.setattr(law_battery, "laws_kernel", cache(law_battery.laws_kernel.__wrapped__))
    law_battery.test_every_law_is_its_twin(PRECISIONS[precision], mapping)


def simulate(law: Any, element: str, precision: str, contact: str = "", **sample: Any) -> Response:
    faces = {"faces": contact, "side": contact} if contact else {}
    samples = Samples.of(poisson=0.495, **sample)
    return impact((law,), samples, element=element, precision=precision, largest_step=4e-7, **faces)


@pytest.mark.parametrize(
    ("element", "precision"),
    [("one_point", "fp64"), ("fbar", "fp64"), pytest.param("one_point", "fp32", marks=pytest.mark.slow)],
)
def test_a_material_law_runs_on_every_element(members: Any, element: str, precision: str) -> None:
    # With the exponent 1 it is neo-Hookean: the same run but for round-off over 1500 steps.
    one = simulate(members[0].of([25e3, 0.5, 1.0]), element, precision)
    other = simulate(LAWS["neo_hookean"].of([25e3]), element, precision)
    assert one.completed.all()
    assert apart(one, other) < (1e-9 if precision == "fp64" else 1e-3)


@pytest.mark.parametrize(("element", "precision"), [("one_point", "fp64"), ("fbar", "fp32")])
def test_a_contact_law_runs_on_every_element(members: Any, element: str, precision: str) -> None:
    law = LAWS["neo_hookean"].example()
    for stress, limit in ((np.inf, "bonded"), (0.0, "rough")):
        one = simulate(law, element, precision, contact="tacky", release_stress=stress)
        other = simulate(law, element, precision, contact=limit, release_stress=stress)
        assert one.completed.all()
        np.testing.assert_array_equal(one.force_transmission, other.force_transmission)


def test_an_element_runs_by_its_name(members: Any) -> None:
    law = LAWS["neo_hookean"].example()
    one, other = (simulate(law, name, "fp64") for name in (members[2].name, "fbar"))
    np.testing.assert_array_equal(one.force_transmission, other.force_transmission)


def test_a_fit_finds_the_constants_of_a_new_law(members: Any) -> None:
    law, stretch = members[0].of([30e3, 0.8, 1.3]), np.linspace(0.4, 2.0, 60)
    stress = incompressible_stress(law, Mode.UNIAXIAL, stretch)
    (candidate,) = candidates(["knowles"])
    found = fit_law(candidate.law, [HomogeneousTest("exact", Mode.UNIAXIAL, stretch, stress)])
    np.testing.assert_allclose(list(found.values.values()), law.constants(), rtol=1e-4)  # of an exact curve


def test_a_name_means_the_same_constants_in_every_command(members: Any) -> None:
    """Fits, specimens and actuators take the constants of [law]; a body has Poisson's ratio too."""
    for name, law in LAWS.items():
        (candidate,) = candidates([name])
        assert (candidate.law, dict(candidate.held)) == (law, {})
        names = [spec.name for spec in law.PARAMETERS]
        assert [spec.name for spec in constants_of(name)] == [*names, "poisson"]


def test_a_shot_may_name_a_new_law(members: Any) -> None:
    section = LawSection.model_validate(
        {
            "name": "knowles", "parameters": {"mu": "30 kPa", "b": 0.8, "n": 1.3}, "branch": "compression",
            "largest_strain": "60 %", "relative_sigma": "3 %",
        }
    )  # fmt: skip
    assert type(section.law) is members[0]
    np.testing.assert_allclose(section.law.constants(), [30e3, 0.8, 1.3])


def test_the_pages_list_a_new_member(members: Any) -> None:
    made = module_of("", TABLES.parent, "made_tables", write=False)
    assert "| `knowles` | W = mu / (2 b) ((1 + b (I1_bar - 3) / n)^n - 1). | `mu`, `b`, `n` |" in made.table(
        "laws"
    )
    assert "`tacky`" in made.table("contact_laws")
    assert "`twin`" in made.table("elements")
    source = ["allowed: <!-- names laws -->"]
    made.fill(None, "page", source)
    assert source[0].startswith("allowed: `neo_hookean`, ")
    assert source[0].endswith("`knowles`")
