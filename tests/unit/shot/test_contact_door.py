"""The registry of contact laws: a shot may declare a new law after one file and one entry of CONTACT_LAWS."""

import shutil
from pathlib import Path

import pytest
from module_files import module_at

from explicit.contact import CONTACT_LAWS
from kolsky.base.errors import InputError
from kolsky.schema.apparatus import CONTACT_KEYS, keys_read
from kolsky.shot.load import load_shot
from kolsky.shot.summary import summarise

OPEN_01 = Path(__file__).resolve().parents[3] / "runs" / "open-01"

NEW_LAW = '''
"""Sticky: slides against friction, and lets go at a release stress."""


class Sticky:
    name = "sticky"
    needs_friction = True
    needs_release_stress = True
    needs_stiffness = False
    carries_tension = True
    slides = True
    remembers_slip = False

    def kernel_function(self, precision):
        raise NotImplementedError
'''


@pytest.fixture
def sticky(tmp_path, monkeypatch) -> None:
    path = tmp_path / "sticky.py"
    path.write_text(NEW_LAW, "utf-8")
    monkeypatch.setitem(CONTACT_LAWS, "sticky", module_at(path).Sticky())


def shot(folder: Path, interface: str) -> Path:
    shutil.copytree(OPEN_01, folder, ignore=shutil.ignore_patterns("results"))
    text = (folder / "shot.toml").read_text("utf-8")
    start = text.index("[interface]")
    end = text.index("[transmission]")
    text = f"{text[:start]}[interface]\n{interface}\n\n{text[end:]}"
    (folder / "shot.toml").write_text(text, "utf-8")
    return folder


@pytest.mark.usefixtures("sticky")
def test_a_new_law_is_declared_with_what_it_needs(tmp_path: Path) -> None:
    said = 'faces = "sticky"\nside = "bonded"\nfriction = 0.25\nrelease_stress = "30 kPa"'
    loaded = load_shot(shot(tmp_path / "shot", said))
    assert (loaded.interface.faces, loaded.interface.friction) == ("sticky", 0.25)
    assert loaded.interface.release_stress == 30e3
    rows = {e.name: (e.value, e.unit) for e in summarise(loaded) if e.section == "interface"}
    assert rows["friction"] == (0.25, "")
    assert rows["release_stress"] == (30e3, "Pa")
    assert "contact_stiffness" not in rows


@pytest.mark.usefixtures("sticky")
@pytest.mark.parametrize(
    ("said", "fragments"),
    [
        ('faces = "sticky"\nside = "bonded"\nfriction = 0.25', ["release_stress is missing"]),
        ('faces = "bonded"\nside = "sticky"\nrelease_stress = "1 kPa"', ["friction is missing"]),
        ('faces = "bonded"\nside = "rough"\nfriction = 0.25', ["no effect", '"coulomb", "penalty" or "sti']),
        ('faces = "glued"\nside = "rough"', ["interface.faces", '"frictionless", "penalty" or "sticky"']),
    ],
)  # fmt: skip
def test_messages_know_a_new_law(said: str, fragments: list[str], tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        load_shot(shot(tmp_path / "shot", said))
    for fragment in fragments:
        assert fragment in str(caught.value)


def test_every_law_of_the_solver_may_be_declared(tmp_path: Path) -> None:
    """Both sides of the registry: none is missing, and none is named that is not there."""
    for name in CONTACT_LAWS:
        numbers = "\n".join(f"{key} = {CONTACT_KEYS[key].example}" for key in keys_read(name))
        loaded = load_shot(shot(tmp_path / name, f'faces = "{name}"\nside = "{name}"\n{numbers}'))
        assert (loaded.interface.faces, loaded.interface.side) == (name, name)


def test_the_springs_of_a_penalty_are_declared(tmp_path: Path) -> None:
    said = 'faces = "penalty"\nside = "penalty"\nfriction = 0.3\ncontact_stiffness = "2e12 Pa/m"'
    loaded = load_shot(shot(tmp_path / "shot", said))
    assert loaded.interface.contact_stiffness == 2e12
    rows = {e.name: e.value for e in summarise(loaded) if e.section == "interface"}
    assert rows["contact_stiffness"] == 2e12
    with pytest.raises(InputError, match=r'contact_stiffness is missing; the law "penalty" needs it'):
        load_shot(shot(tmp_path / "other", said.replace('contact_stiffness = "2e12 Pa/m"', "")))


@pytest.mark.parametrize(
    ("laws", "keys"),
    [
        (("bonded", "rough"), []),
        (("coulomb", "bonded"), ["friction"]),
        (("bonded", "bonded_release"), ["release_stress"]),
        (("bonded_release", "coulomb"), ["friction", "release_stress"]),
        (("penalty", "frictionless"), ["friction", "contact_stiffness"]),
    ],
)
def test_the_keys_that_two_laws_read(laws: tuple[str, str], keys: list[str]) -> None:
    assert keys_read(*laws) == keys


def test_law_names_stand_in_one_place_only() -> None:
    """Who needs a law asks the registry; the law of parameters that slide has a name of its own."""
    root = OPEN_01.parents[1] / "kolsky"
    # The ends of a quasi-static test are another thing: a radius that the test itself shows, no contact law.
    quasi_static = {
        "material/end_friction",
        "material/slow_compression.py",
        "equilibrium",
        "cli/material_curves.py",
    }
    found = [
        f"{path.relative_to(root)}:{number}"
        for path in sorted(root.rglob("*.py"))
        if not any(path.relative_to(root).as_posix().startswith(place) for place in quasi_static)
        for number, line in enumerate(path.read_text("utf-8").splitlines(), start=1)
        if any(f'"{name}"' in line for name in CONTACT_LAWS) and "ING_LAW = " not in line
    ]
    assert found == []
