"""One parameter of the simulated test: everything that is asked of it by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from kolsky.shot.records import Shot

Fields = Mapping[str, Any]
"""Fields of `explicit.Samples` by name: numbers, or arrays of shape [n_samples]."""


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """One parameter of the simulated test."""

    name: str
    """Name at the API and the command line."""
    words: str
    """What it is, as tables and axes of the report write it."""
    symbol: str
    """Symbol in plain text of the command line."""
    written: str
    """Symbol in the text of pages."""
    tex: str
    """Symbol in figures and documentation, without dollar signs."""
    unit: str = "1"
    """SI unit, "1" if none."""
    shown_unit: str = "1"
    """Unit in which pages and figures show it."""
    shown_factor: float = 1.0
    """Shown number over the number in SI."""
    lower: float
    """Lower bound of the default design."""
    upper: float
    """Upper bound of the default design."""
    allowed: tuple[float, float]
    """Range outside which a value is refused."""
    held: Callable[[Shot], float]
    """The value that a shot declares for it."""
    enters: Callable[[Fields, Any], Fields] | None = None
    """The solver's samples with a value of it, from those without; None sets the field of its name."""
    uncertainty: bool = False
    """Whether [uncertainty] of shot.toml has a key of its name."""
    slides: bool = False
    """Whether naming it makes end faces and side surface slide by Coulomb's law, whatever is declared."""
    read_by: str = ""
    """Field of `explicit.contact.ContactLaw` that says whether a law reads it; empty if no contact law is
    needed for it to have an effect."""
    without: str = ""
    """Why it has no effect where no contact law reads it, in words."""
    scale: Callable[[float], float] | None = None
    """A change from a value that counts as large, in its unit; None takes `explicit.stencils.scale_of`."""
    changed: Callable[[Shot, float], Shot] | None = None
    """The shot with another declared value; needed where naming the parameter does more than that."""
    logarithmic: bool = False
    """Whether a search moves its logarithm: its range spans decades."""
    relaxes: bool = False
    """Whether it is a constant of what relaxes, which only a shot with such a [relaxation] has."""

    def entered(self, fields: Fields, value: Any) -> Fields:
        """The solver's samples with a value of the parameter."""
        return {**fields, self.name: value} if self.enters is None else self.enters(fields, value)

    def belongs_to(self, shot: Shot) -> bool:
        """True if a simulation of the shot has it: all have but for the constants of what relaxes."""
        return not self.relaxes or (shot.relaxation is not None and self.name in shot.relaxation.values)
