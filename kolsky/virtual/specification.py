"""A specification file: read, checked, and expanded to its shots.

[population] draws quantities from ranges.

Each shot and subject has a separate random stream. A new subject therefore does not change the others.
"""

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal
from zlib import crc32

import numpy as np
from pydantic import Field, model_validator

from kolsky.base.errors import InputError, refused
from kolsky.base.toml import TomlFile, read_toml
from kolsky.readers.text import full_match
from kolsky.schema import fields as f
from kolsky.schema.fields import Section
from kolsky.virtual.schema import Specification


def stream(seed: int, shot: int, *subject: str) -> np.random.Generator:
    """The random stream of one subject of one shot, independent of all other draws and shots.

    ``seed``: that of the specification. ``shot``: number of the shot in its population, beginning at 1; 0
    without a population. ``subject``: words for the drawn quantity, e.g. "noise", "transmitted".
    """
    return np.random.default_rng([seed, shot, *(crc32(word.encode()) for word in subject)])


_WRITTEN = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*", re.DOTALL)
DIGITS = 9
"""Digits of a drawn number."""
Bound = int | float | str
_KINDS = {"even": ("low", "high"), "log": ("low", "high"), "normal": ("mean", "sigma")}
"""Spread -> the two keys that it needs."""


class Draw(Section):
    """One entry of [population.draw]: a range, a normal distribution, or a list to choose from."""

    low: Bound | None = None
    high: Bound | None = None
    mean: Bound | None = None
    sigma: Bound | None = None
    spread: Literal["even", "log", "normal"] = "even"
    """Uniform, uniform in the logarithm, or normal with mean `mean` and standard deviation `sigma`."""
    choose: list[Any] | None = None
    """List of values, or of tables. The keys of a table are set together. One entry is chosen."""

    @model_validator(mode="after")
    def _one_kind(self) -> "Draw":
        given = {key for key in ("low", "high", "mean", "sigma", "choose") if getattr(self, key) is not None}
        if given == {"choose"} and self.choose:
            return self
        if given != set(_KINDS[self.spread]):
            raise f.problem(
                "is not a distribution",
                allowed='{ low, high }, { low, high, spread = "log" }, { mean, sigma, spread = "normal" } or '
                "{ choose = [...] }",
            )
        try:
            first, second, _, _ = self._bounds()
        except ValueError as error:
            raise f.problem(str(error), cure='write e.g. { low = "8 mm", high = "12 mm" }') from None
        if self.spread == "normal" and second < 0.0:
            raise f.problem("is not allowed", key="sigma", allowed=">= 0")
        if self.spread != "normal" and not first <= second:
            raise f.problem("is not allowed", key="high", allowed="not below low")
        if self.spread == "log" and first <= 0.0:
            raise f.problem("is not allowed", key="low", allowed="above 0")
        return self

    def _bounds(self) -> tuple[float, float, str | None, bool]:
        """The two numbers, their unit (None for plain ones), and True if both are whole numbers."""
        first, second = (getattr(self, key) for key in _KINDS[self.spread])
        if isinstance(first, str) and isinstance(second, str):
            matches = [full_match(_WRITTEN, text) for text in (first, second)]
            if None in matches:
                raise ValueError("holds a text that is not a number with a unit")
            (a, unit), (b, other) = (match.groups() for match in matches if match)
            if unit != other:
                raise ValueError(f"has the units {unit!r} and {other!r}, which must be written alike")
            return float(a), float(b), unit, False
        if isinstance(first, str) or isinstance(second, str):
            raise ValueError("has a unit at one end only")
        assert first is not None  # the keys were looked at before
        assert second is not None
        whole = isinstance(first, int) and isinstance(second, int)
        return float(first), float(second), None, whole

    def value(self, rng: np.random.Generator) -> Any:
        """A drawn value in the form of a specification."""
        if self.choose is not None:
            return self.choose[int(rng.integers(len(self.choose)))]
        first, second, unit, whole = self._bounds()
        if whole and self.spread == "even":
            return int(rng.integers(int(first), int(second), endpoint=True))
        share = float(rng.standard_normal() if self.spread == "normal" else rng.random())
        if self.spread == "log":
            drawn = first * math.exp(share * math.log(second / first))
        else:
            drawn = first + share * (second if self.spread == "normal" else second - first)
        rounded = float(f"{drawn:.{DIGITS}g}")
        return rounded if unit is None else f"{rounded:.{DIGITS}g} {unit}"


class Population(Section):
    """[population]: number of shots, and the quantities drawn for each."""

    shots: Annotated[int, Field(ge=1, le=100_000)]
    draw: dict[str, Draw] = Field(default_factory=dict)


NAME = "SPEC.toml"
"""The name of the specification from `kolsky virtual new`."""


class SpecificationFile(Specification):
    """A complete specification file: the specification of a shot, and the draws of a series."""

    population: Population | None = None
    budget: dict[str, Any] | None = None
    """Dotted key -> standard uncertainty, for `kolsky budget`."""


@dataclass(frozen=True)
class ShotSpecification:
    """The specification of one synthetic shot."""

    number: int
    """Its number in the population, beginning at 1. It is 0 if the specification is that of a single shot."""
    name: str
    """Its name. In a population, it is the name of its folder."""
    content: dict[str, Any]
    """The specification in written form, without [population]."""
    quantities: Specification
    folder: Path
    """Folder of the specification and of its other files."""


@dataclass(frozen=True)
class Series:
    """The contents of a specification file."""

    file: TomlFile
    declared: SpecificationFile
    """The declared values in SI. A drawn quantity has its written or default value."""

    @property
    def numbers(self) -> range:
        """Numbers of the shots: 1 to n for a population, otherwise only 0."""
        population = self.declared.population
        return range(1) if population is None else range(1, population.shots + 1)

    def shot(self, number: int) -> ShotSpecification:
        """One shot's specification.

        Raises InputError if there is no such shot, or if its drawn values are not allowed.
        """
        declared, population = self.declared, self.declared.population
        if number not in self.numbers:
            raise InputError(
                self.file.path, f"has no shot {number}", allowed=f"in [{self.numbers[0]}, {self.numbers[-1]}]"
            )
        if population is None:
            return ShotSpecification(0, declared.name, self.file.content, declared, self.file.path.parent)
        cure = "write low and high as numbers with one unit"
        with refused(self.file.path, key="population.draw", cure=cure):
            draws = {
                key: draw.value(stream(declared.seed, number, "draw", key))
                for key, draw in population.draw.items()
            }
        made = self.file.varied(draws)
        for table in ("population", "budget"):
            made.content.pop(table, None)
        width = len(str(population.shots))
        name = f"{declared.name}-{number:0{width}d}"
        quantities = made.validated(Specification)
        return ShotSpecification(number, name, made.content, quantities, self.file.path.parent)

    def __iter__(self) -> Iterator[ShotSpecification]:
        return (self.shot(number) for number in self.numbers)


def read_specification(path: str | Path) -> Series:
    """Read and check a specification, with its first drawn shot.

    ``path``: the file, or the folder with a `SPEC.toml`. Raises InputError if it cannot be read or is not
    TOML, or if it declares anything unknown or not allowed.
    """
    path = Path(path)
    if path.is_dir():
        path = path / NAME
    if not path.exists():
        raise InputError(path, "there is no such file", cure="`kolsky virtual new FOLDER` writes one")
    series = Series(*read_toml(path, SpecificationFile))
    series.shot(series.numbers[0])
    return series
