"""A specification file: read, checked, and unfolded to its shots."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from kolsky.base.errors import InputError
from kolsky.shot.schema.reading import TomlFile, parse_toml
from kolsky.virtual.population import Population, drawn
from kolsky.virtual.schema import Specification

NAME = "SPEC.toml"
"""The name of a specification that `kolsky virtual new` writes."""


class SpecificationFile(Specification):
    """A whole specification file: that of a shot, and how a series is drawn."""

    population: Population | None = None
    budget: dict[str, Any] | None = None
    """Dotted key -> standard uncertainty, for `kolsky budget`."""


@dataclass(frozen=True)
class ShotSpecification:
    """One shot to be made."""

    number: int
    """Its number in the population, from 1; 0 if the specification is that of a single shot."""
    name: str
    """Its name, which is that of its folder in a population."""
    content: dict[str, Any]
    """The specification as it would be written, without [population]."""
    quantities: Specification
    """The same in SI."""
    folder: Path
    """Where the specification lies: files that it names are beside it."""


@dataclass(frozen=True)
class Series:
    """A specification file read."""

    file: TomlFile
    """The file as parsed."""
    declared: SpecificationFile
    """What it declares, in SI; a drawn quantity has the value written for it, or its default."""

    @property
    def numbers(self) -> range:
        """Numbers of the shots: 1 to n of a population, else 0 alone."""
        population = self.declared.population
        return range(1) if population is None else range(1, population.shots + 1)

    def shot(self, number: int) -> ShotSpecification:
        """One shot's specification.

        Raises
        ------
        InputError
            If there is no such shot, or what was drawn for it cannot be.
        """
        declared, population = self.declared, self.declared.population
        if number not in self.numbers:
            raise InputError(
                self.file.path,
                f"has no shot {number}",
                allowed=f"in [{self.numbers[0]}, {self.numbers[-1]}]",
            )
        if population is None:
            return ShotSpecification(0, declared.name, self.file.content, declared, self.file.path.parent)
        try:
            content = drawn(self.file.content, population, seed=declared.seed, shot=number)
        except ValueError as error:
            raise InputError(
                self.file.path,
                str(error),
                key="population.draw",
                cure="write low and high as numbers with one unit",
            ) from None
        width = len(str(population.shots))
        name = f"{declared.name}-{number:0{width}d}"
        quantities = TomlFile(self.file.path, self.file.sha256, content, self.file.lines).validated(
            Specification
        )
        return ShotSpecification(number, name, content, quantities, self.file.path.parent)

    def __iter__(self) -> Iterator[ShotSpecification]:
        return (self.shot(number) for number in self.numbers)


def read_specification(path: str | Path) -> Series:
    """Read and check a specification, with the first shot that it draws.

    Parameters
    ----------
    path
        The file, or the folder with a `SPEC.toml`.

    Raises
    ------
    InputError
        If it cannot be read, is no TOML, or declares anything unknown or impossible.
    """
    path = Path(path)
    if path.is_dir():
        path = path / NAME
    if not path.exists():
        raise InputError(path, "there is no such file", cure="`kolsky virtual new FOLDER` writes one")
    file = parse_toml(path)
    series = Series(file, file.validated(SpecificationFile))
    series.shot(series.numbers[0])
    return series
