"""Errors about invalid input.

One line with file, line, key, value, allowed range and remedy.
"""

import json
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from dic.files import one_line

_LONGEST_VALUE = 80


class InputError(Exception):
    """Invalid input of the user. Its `str()` is one line.

    Parameters
    ----------
    path
        The file or folder at fault.
    message
        What is wrong, e.g. "is not allowed".
    line
        Line in the file, counted from 1.
    key, value
        Dotted key of the shot file, e.g. "specimen.density", and its value as written.
    allowed
        The allowed range or choice; printed after "it must be".
    cure
        How to correct the input; printed after "Cure:".
    """

    def __init__(
        self,
        path: str | Path,
        message: str,
        *,
        line: int | None = None,
        key: str | None = None,
        value: object = None,
        allowed: str | None = None,
        cure: str | None = None,
    ) -> None:
        super().__init__(path, message)  # the other attributes are pickled with it
        self.path = Path(path)
        self.message = message
        self.line = line
        self.key = key
        self.value = value
        self.allowed = allowed
        self.cure = cure

    def __str__(self) -> str:
        place = str(self.path) if self.line is None else f"{self.path} line {self.line}"
        subject = "" if self.key is None else f"{self.key} "
        if self.key is not None and self.value is not None:
            subject += f"= {_shown(self.value)} "
        text = f"{place}: {subject}{self.message}"
        if self.allowed is not None:
            text += f"; it must be {self.allowed}"
        if self.cure is not None:
            text += f". Cure: {self.cure}"
        return one_line(text)

    @property
    def problems(self) -> tuple["InputError", ...]:
        """The single problems, at least one."""
        return (self,)


class InputErrors(InputError):
    """Several problems in one error. `str()` gives one line for each."""

    def __init__(self, problems: Iterable[InputError]) -> None:
        self.args = (tuple(problems),)
        vars(self).update(vars(self.problems[0]))

    def __str__(self) -> str:
        return "\n".join(str(problem) for problem in self.problems)

    @property
    def problems(self) -> tuple[InputError, ...]:
        """The single problems, in the order in which they were found."""
        problems: tuple[InputError, ...] = self.args[0]
        return problems


@contextmanager
def refused(
    place: str | Path,
    before: str = "",
    *,
    key: str | None = None,
    line: int | None = None,
    cure: str,
    errors: tuple[type[Exception], ...] = (ValueError,),
) -> Iterator[None]:
    """Make a ValueError inside it, or one of the errors, bad input with a remedy.

    `before` begins its text.
    """
    try:
        yield
    except errors as error:
        raise InputError(place, f"{before}{error}", key=key, line=line, cure=cure) from error


def refuse(problems: list[InputError]) -> None:
    """Raise the problems, if there are any.

    Raises InputError: the only problem, or an `InputErrors` that contains them all.
    """
    if len(problems) == 1:
        raise problems[0]
    if problems:
        raise InputErrors(problems)


def _shown(value: object) -> str:
    """A value in TOML, as a user would write it. A long value is shortened."""
    text = json.dumps(value, ensure_ascii=False, default=str)
    return text if len(text) <= _LONGEST_VALUE else text[: _LONGEST_VALUE - 3] + "..."
