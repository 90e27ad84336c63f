"""Every error message in the sources names a cure or the allowed values."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
REFUSALS = ("InputError", "refusal", "CameraFileError")  # a PictureError has a cure of its own


def without_cure(source: str) -> list[str]:
    """The calls of `REFUSALS` that name neither."""
    found = []
    for call in ast.walk(ast.parse(source)):
        name = getattr(call.func, "id", getattr(call.func, "attr", "")) if isinstance(call, ast.Call) else ""
        if not isinstance(call, ast.Call) or name not in REFUSALS:
            continue
        keywords = {keyword.arg for keyword in call.keywords}
        if keywords & {"cure", "allowed"} or None in keywords:
            continue
        said = ast.unparse(call)
        if "must be" not in said and "must have" not in said and "allowed" not in said:
            found.append(f"line {call.lineno}: {said[:100]}")
    return found


def test_the_look_itself() -> None:
    assert without_cure("raise InputError(path, 'is odd')")
    assert not without_cure("raise InputError(path, 'is odd', cure='mend it')")
    assert not without_cure("raise errors.InputError(path, 'is odd', allowed='> 0')")


@pytest.mark.parametrize("package", ["kolsky", "dic"])
def test_every_refusal_names_a_cure_or_what_is_allowed(package: str) -> None:
    found = {
        str(path.relative_to(ROOT)): lines
        for path in sorted((ROOT / package).rglob("*.py"))
        if (lines := without_cure(path.read_text(encoding="utf-8")))
    }
    assert not found
