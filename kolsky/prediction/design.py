"""Design of a test: any quantities of its file varied, and the point that does as wanted."""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, fields

import numpy as np

from doe import Box, CostSurrogate, full_factorial, nelder_mead
from doe.surrogates import SurrogateError
from kolsky.base.arrays import FloatArray
from kolsky.base.errors import InputError
from kolsky.base.toml import TomlFile
from kolsky.prediction.predict import Numbers, PlannedTest, predict
from kolsky.prediction.schema import TestFile

NAMES = tuple(field.name for field in fields(Numbers))
"""Numbers that can be wanted."""
AIM_TOLERANCE = 0.01
"""Largest relative distance from what is wanted at which it is reached."""
ROUNDS = 4
"""Most runs at the point that the surfaces promise, each joined to them."""
EQUAL_POINTS = 1e-6
"""Points of the unit box closer than this are one run."""
DIGITS = 6
"""Digits of a varied quantity."""

_RANGE = re.compile(
    r"\s*([\w.]+)\s*=\s*([+-]?[\d.]+(?:[eE][+-]?\d+)?)\s*([^:]*?)\s*:\s*([+-]?[\d.]+(?:[eE][+-]?\d+)?)\s*"
    r"([^:]*?)\s*(?::\s*(\d+)\s*)?"
)


@dataclass(frozen=True)
class Varied:
    """A quantity of the test's file that is varied."""

    key: str
    """Dotted key, e.g. "striker.speed"."""
    low: float
    """Lower bound, in `unit`."""
    high: float
    """Upper bound."""
    unit: str
    """Unit as written; empty for a plain number."""
    levels: int = 5
    """Number of values."""

    @classmethod
    def of(cls, text: str) -> "Varied":
        """From "striker.speed=4 m/s:7 m/s:5".

        Raises ValueError if it cannot be read.
        """
        match = _RANGE.fullmatch(text)
        if match is None:
            raise ValueError(f"{text!r} is not KEY=LOW:HIGH[:LEVELS], e.g. striker.speed=4 m/s:7 m/s:5")
        key, low, first, high, second, levels = match.groups()
        unit = second or first
        if first and first != second:
            raise ValueError(f"{text!r} has the units {first!r} and {second!r}; write both alike")
        made = cls(key, float(low), float(high), unit, int(levels or 5))
        if not made.low < made.high or not 2 <= made.levels <= 100:
            raise ValueError(f"{text!r} needs LOW < HIGH and 2 to 100 LEVELS")
        return made

    def written(self, value: float) -> float | str:
        """A value as the file would have it."""
        rounded = float(f"{value:.{DIGITS}g}")
        return f"{rounded:.{DIGITS}g} {self.unit}" if self.unit else rounded


@dataclass(frozen=True)
class Scan:
    """Predictions over a grid of quantities."""

    varied: tuple[Varied, ...]
    """What was varied."""
    points: FloatArray
    """Values in the units of `varied`, shape [n, d]."""
    numbers: tuple[Numbers, ...]
    """Of each point."""

    def column(self, name: str) -> FloatArray:
        """One number at every point, shape [n]."""
        return np.array([getattr(one, name) for one in self.numbers])


@dataclass(frozen=True)
class Aim:
    """The point that comes nearest to what is wanted, confirmed by a run there."""

    wanted: dict[str, float]
    """Numbers wanted, SI."""
    at: dict[str, float]
    """Values of the quantities, in their units."""
    numbers: Numbers
    """What the run there gives."""
    distance: float
    """Largest relative distance from a wanted number [-]."""
    at_bound: tuple[str, ...]
    """Quantities that lie at a bound of their range."""

    @property
    def reached(self) -> bool:
        """True if every number is there to `CLOSE`."""
        return self.distance <= AIM_TOLERANCE


def varied_test(test: PlannedTest, values: Mapping[str, float | str]) -> PlannedTest:
    """The test with other values of some keys, checked as its file was.

    Raises InputError if a key leads nowhere, or a value is not allowed.
    """
    content = deepcopy(test.file.content)
    for key, value in values.items():
        table = content
        *path, last = key.split(".")
        for part in path:
            inner = table.setdefault(part, {})
            if not isinstance(inner, dict):
                raise InputError(
                    test.file.path, "is no table", key=key, cure="write it as a table of the test file"
                )
            table = inner
        table[last] = value
    file = TomlFile(test.file.path, test.file.sha256, content, test.file.lines)
    return PlannedTest(file, file.validated(TestFile))


def scan(
    test: PlannedTest, varied: Sequence[Varied], *, progress: Callable[[int, int], None] = lambda n, m: None
) -> Scan:
    """Predict the test over a full factorial, the specimen by its static curve.

    ``test``: the test as declared. Raises InputError if a value is not allowed.
    """
    design = full_factorial(_box(varied), [one.levels for one in varied])
    tests = [_at(test, varied, point) for point in design.points]  # all are checked before the first run
    found = []
    for n, one in enumerate(tests):
        progress(n, len(tests))
        found.append(predict(one, quick=True).numbers)
    progress(len(tests), len(tests))
    return Scan(tuple(varied), np.array(design.points), tuple(found))


def aim(test: PlannedTest, found: Scan, wanted: Mapping[str, float]) -> Aim:
    """The point of a scan's box that does as wanted, by surfaces through its numbers and runs there.

    ``test``: the test as declared. ``wanted``: numbers of `NAMES` and their values, SI. Raises ValueError if
    a name is unknown, a wanted value is not positive, or too few points know the number.
    """
    for name, value in wanted.items():
        if name not in NAMES:
            raise ValueError(f"there is no number {name!r}; choose from {', '.join(NAMES)}")
        if not (value > 0.0 and math.isfinite(value)):
            raise ValueError(f"{name} = {value:g} cannot be wanted: it must be above 0")
    box, points, numbers = _box(found.varied), found.points, list(found.numbers)
    tried: list[tuple[float, FloatArray, Numbers]] = []
    for _ in range(ROUNDS):
        x = _promised(box, points, numbers, wanted)
        away = np.abs(box.unit(points) - box.unit(x)).max(axis=1)
        if away.min() < EQUAL_POINTS:
            row = int(np.argmin(away))
            tried.append((distance(numbers[row], wanted), points[row], numbers[row]))
            break
        here = predict(_at(test, found.varied, x), quick=True).numbers
        tried.append((distance(here, wanted), x, here))
        if tried[-1][0] <= 0.1 * AIM_TOLERANCE:
            break
        points, numbers = np.vstack([points, x]), [*numbers, here]
    nearest, x, best = min(tried, key=lambda one: one[0])
    u = box.unit(x)
    edges = tuple(name for name, share in zip(box.names, u, strict=True) if not 1e-4 < share < 1.0 - 1e-4)
    return Aim(dict(wanted), box.as_dict(x), best, nearest, edges)


def distance(found: Numbers, wanted: Mapping[str, float]) -> float:
    """Largest relative distance from a wanted number; infinite where one is not known."""
    away = [abs(getattr(found, name) / value - 1.0) for name, value in wanted.items()]
    return float(max(away)) if np.isfinite(away).all() else math.inf


def _promised(
    box: Box, points: FloatArray, numbers: Sequence[Numbers], wanted: Mapping[str, float]
) -> FloatArray:
    """Where surfaces through the numbers come nearest to what is wanted."""
    surfaces = {}
    for name in wanted:
        values = np.array([getattr(one, name) for one in numbers])
        known = np.isfinite(values)
        try:
            surfaces[name] = CostSurrogate.fit(box, points[known], values[known])
        except (SurrogateError, ValueError) as error:
            raise ValueError(f"{name} is known at {known.sum()} points of the scan only: {error}") from None

    def cost(x: FloatArray) -> float:
        return sum((surfaces[name].cost(x) / value - 1.0) ** 2 for name, value in wanted.items())

    grid = full_factorial(box, 31 if box.dimension < 3 else 9).points
    far = np.sum(
        [(surfaces[name].predict(grid)[:, 0] / value - 1.0) ** 2 for name, value in wanted.items()], axis=0
    )
    return nelder_mead(cost, box, start=grid[int(np.argmin(far))]).x


def _box(varied: Sequence[Varied]) -> Box:
    return Box.of({one.key: (one.low, one.high) for one in varied})


def _at(test: PlannedTest, varied: Sequence[Varied], point: FloatArray) -> PlannedTest:
    written = {one.key: one.written(float(x)) for one, x in zip(varied, point, strict=True)}
    return varied_test(test, written)
