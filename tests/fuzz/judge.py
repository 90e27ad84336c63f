"""Evaluation of an answer to a damaged file."""

import hashlib
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

from dic.camera_files.source import CameraFileError
from dic.images.series import PictureError
from doe.ledger import LedgerError
from kolsky.base.errors import InputError

REFUSALS = (InputError, PictureError, CameraFileError, LedgerError)
"""The errors by which a file is refused; each is one line a problem."""
LONGEST = 10.0  # longest time that an answer may take [s]
HELPFUL = re.compile(r"Cure: \S|\bmust (be|have) |\ballowed are |; \w")
"""What a refusal says besides what is wrong: "is not allowed" alone helps nobody."""
LARGEST = 1.5e9  # most memory that a refused file may take [bytes]


class Verdict(Enum):
    """What became of a case."""

    REFUSED = "refused"  # in one line with file and cure
    ACCEPTED = "accepted"  # Rightly, as far as anyone can tell from the file
    WRONG = "silent wrong"  # accepted although the file says that something is missing or changed
    TRACEBACK = "traceback"  # another error than a refusal
    UNHELPFUL = "unhelpful"
    """Refused without the file's name, in several lines, or with neither a cure nor what is allowed."""
    SLOW = "slow"  # it took longer than `LONGEST`
    LARGE = "large"  # it took more memory than `LARGEST`
    DIED = "died"  # the process ended

    @property
    def good(self) -> bool:
        """Whether that is as it should be."""
        return self in (Verdict.REFUSED, Verdict.ACCEPTED)


@dataclass(frozen=True)
class Answer:
    """The answer to one case."""

    case: str  # its name: target, damage, seed
    verdict: Verdict  # what became of it
    said: str  # the refusal or what is wrong
    seconds: float  # time [s]
    memory: float  # growth of the largest resident memory [bytes]


def of_refusal(error: Exception, path: Path) -> tuple[Verdict, str]:
    """Whether a refusal says what it must."""
    said = str(error)
    problems = error.problems if isinstance(error, InputError) else (error,)
    if len(said.splitlines()) != len(problems):
        return Verdict.UNHELPFUL, f"several lines: {said!r}"
    if not all(c.isprintable() or c == "\n" for c in said):
        return Verdict.UNHELPFUL, f"steers the terminal: {said!r}"
    if path.name not in said and path.parent.name not in said:
        return Verdict.UNHELPFUL, f"names no file: {said}"
    for problem in problems:
        text = str(problem)
        if not HELPFUL.search(text):
            return Verdict.UNHELPFUL, f"names no cure: {text}"
    return Verdict.REFUSED, said


def of_content(content: Any, sound: Any, *, cut: bool, told_length: bool, told_values: bool) -> str:
    """What is silently wrong with an accepted content; empty if nothing is.

    ``content``, ``sound``: what was read of the damaged and of the sound file. ``cut``: whether the end of
    the file is missing. ``told_length``, ``told_values``: as of `tests.fuzz.targets.Target`.
    """
    if told_values:
        pairs = zip(content, sound, strict=True)
        return (
            "" if all(one is None or digest(one) == digest(two) for one, two in pairs) else "another result"
        )
    if cut and told_length and digest(content) != digest(sound):
        return "its end is missing"
    return unbelievable(content)


def unbelievable(content: Any, place: str = "content") -> str:
    """The first number of a recording that is not finite or larger than anything measured; empty if none."""
    if not hasattr(content, "items"):
        return ""
    for name, item in content.items():
        value = getattr(item, "value", None)
        if isinstance(value, np.ndarray) and not (np.isfinite(value).all() and np.abs(value).max() < 1e300):
            return f"{place}.{name} holds what no recorder gives"
    return ""


def digest(content: Any) -> str:
    """SHA-256 of all that a content holds; paths and hashes of files are left out."""
    total = hashlib.sha256()
    _add(total, content)
    return total.hexdigest()


def _add(total: Any, content: Any) -> None:
    if is_dataclass(content) and not isinstance(content, type):
        for field in fields(content):
            if field.name not in ("path", "sha256", "folder", "inputs", "hashes", "facts"):
                _add(total, getattr(content, field.name))
    elif isinstance(content, np.ndarray):
        total.update(str(content.shape).encode() + np.ascontiguousarray(content).tobytes())
    elif isinstance(content, Mapping):
        for key in content:
            _add(total, key)
            _add(total, content[key])
    elif isinstance(content, list | tuple | set | frozenset):
        for item in content:
            _add(total, item)
    elif isinstance(content, float):
        total.update(b"nan" if math.isnan(content) else content.hex().encode())
    elif isinstance(content, int | str | bytes | bool | Enum) or content is None:
        total.update(repr(content).encode())
