"""Every input that is named has a test or a trap that is there."""

import ast
from pathlib import Path

import pytest

from tests.fuzz.hostile import ANYWHERE, IN_TEXT, OWN, traps
from tests.fuzz.named import CORPUS, KINDS, table

ROOT = Path(__file__).resolve().parents[2]
TRAPS = {*ANYWHERE, *IN_TEXT, *OWN}


def is_there(place: str) -> bool:
    """Whether a place of the table is a test function of its file, or a trap."""
    file, _, name = place.partition("::")
    if not name:
        return place.removeprefix(f"{CORPUS}: ") in TRAPS
    tree = ast.parse((ROOT / file).read_text(encoding="utf-8"))
    return any(isinstance(one, ast.FunctionDef) and one.name == name for one in tree.body)


@pytest.mark.parametrize("kind", KINDS)
def test_every_place_is_there(kind: str) -> None:
    lost = [place for one in KINDS[kind] for place in one.places if not is_there(place)]
    assert not lost
    assert all(one.places for one in KINDS[kind])


def test_the_look_can_say_no() -> None:
    assert not is_there(f"{CORPUS}: no such trap")
    assert not is_there("tests/fuzz/test_named.py::test_that_is_not")
    assert is_there("tests/fuzz/test_named.py::test_the_look_can_say_no")


def test_every_trap_of_its_own_is_named_or_in_the_corpus() -> None:
    assert {trap.name for trap in traps()} == TRAPS


def test_the_table_has_a_row_each() -> None:
    rows = table().splitlines()
    assert len(rows) == 2 + sum(map(len, KINDS.values()))
    assert all(row.count(" | ") == 3 for row in rows)
