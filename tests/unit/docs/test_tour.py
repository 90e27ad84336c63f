"""The code tour names files and functions that are there."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
ROW = re.compile(r"^\| (Where .*\?) \| `([^`]+)` \| `([^`]+)` \|$", re.MULTILINE)
QUESTIONS = ROW.findall((ROOT / "docs" / "where.md").read_text("utf-8"))
TOUR = (ROOT / "docs" / "tour.md").read_text("utf-8")


def defined_in(file: Path) -> set[str]:
    """Names that a module defines at its top."""
    names = set()
    for node in ast.parse(file.read_text("utf-8")).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.add(node.name)
        elif isinstance(node, ast.Assign):
            names |= {target.id for target in node.targets if isinstance(target, ast.Name)}
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            names.add(node.target.id)
    return names


def test_there_are_twenty_questions() -> None:
    assert len(QUESTIONS) >= 20
    assert len({question for question, _, _ in QUESTIONS}) == len(QUESTIONS)


@pytest.mark.parametrize(("question", "file", "name"), QUESTIONS, ids=[q for q, _, _ in QUESTIONS])
def test_the_answer_is_there(question: str, file: str, name: str) -> None:
    assert (ROOT / file).is_file()
    assert name in defined_in(ROOT / file)


@pytest.mark.parametrize(
    "place", sorted(set(re.findall(r"`((?:kolsky|dic|explicit|implicit|doe|tests)/[\w/.]*)`", TOUR)))
)
def test_a_place_of_the_tour_is_there(place: str) -> None:
    assert (ROOT / place).exists()
