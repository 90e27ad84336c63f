"""Methods of every result: a figure, a table of pandas, and a short text.

Figures and tables are made by `kolsky.report.notebook`, which `dic` must not import. Importing `kolsky`
registers that module here.
"""

from collections.abc import Callable, Sized
from dataclasses import fields
from enum import Enum
from typing import Any

MAKERS: list[Callable[[], Any]] = []
"""Functions that return the module with `plot`, `html` and `to_dataframe`; the last is used."""
LONGEST = 160
"""Largest number of characters of a result's text."""


def _maker(result: object) -> Any:
    if not MAKERS:
        raise ImportError(f"figures and tables of {type(result).__name__} are made by kolsky: import kolsky")
    return MAKERS[-1]()


class ResultViews:
    """A result with a figure, tables and a short text."""

    def plot(self, figure: str = "") -> Any:
        """Draw a figure of the report.

        Parameters
        ----------
        figure
            Name of the figure, the name of its file with ``--figures``; the first figure if omitted.

        Returns
        -------
        matplotlib.figure.Figure
            The figure, with its caption as label.

        Raises
        ------
        TypeError
            If there is no figure for this type of result.
        ValueError
            If there is no figure of that name; the message lists the names.
        """
        return _maker(self).plot(self, figure)

    def to_pandas(self, table: str = "") -> Any:
        """Return a table (SI, units in the headings); see `kolsky.report.notebook.to_dataframe`.

        Parameters
        ----------
        table
            Name of a CSV file of the result without ".csv"; the main table if omitted.

        Returns
        -------
        pandas.DataFrame
        """
        return _maker(self).to_dataframe(self, table)

    def _repr_html_(self) -> str | None:
        """A table for a notebook; None, and then the short text is shown, if there is none of this type."""
        return MAKERS[-1]().html(self) if MAKERS else None

    def __init_subclass__(cls, **options: Any) -> None:
        """Keep the short text, because a dataclass would print all its arrays."""
        super().__init_subclass__(**options)
        cls.__repr__ = cls.__repr__  # type: ignore[method-assign]

    def __repr__(self) -> str:
        shown = ((field.name, getattr(self, field.name)) for field in fields(self))  # type: ignore[arg-type]
        text = ", ".join(part for name, value in shown if (part := _part(name, value)))
        return f"{type(self).__name__}({text if len(text) <= LONGEST else text[: LONGEST - 1] + '…'})"


def _part(name: str, value: object) -> str:
    """A number or a name unchanged, the size of a container, and an empty text for other objects."""
    if shape := getattr(value, "shape", ()):
        return f"{name}: {' × '.join(map(str, shape))}"
    if isinstance(value, Enum | str | bool | int):
        return f"{name}={getattr(value, 'value', value)!r}"
    if isinstance(value, float):
        return f"{name}={value:.6g}"
    return f"{name}: {len(value)}" if isinstance(value, Sized) and len(value) else ""
