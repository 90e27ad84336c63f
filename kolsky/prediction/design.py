"""Design of a test.

Quantities of its file are varied, the point with the requested results is searched, and predictions are
written as tables.
"""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from doe import Box, CostSurrogate, full_factorial, nelder_mead
from doe.surrogates import SurrogateError
from kolsky.base.arrays import FloatArray
from kolsky.base.files import jsonable, write_table
from kolsky.prediction.predict import Numbers, PlannedTest, Prediction, doubts, predict
from kolsky.prediction.schema import TestFile
from kolsky.virtual.motion import MOVES
from kolsky.virtual.shot_file import KNOT, MOTION, STEEL, relaxation_table, si_texts, toml_text

NAMES = tuple(field.name for field in fields(Numbers))
"""Results that can be prescribed."""
AIM_TOLERANCE = 0.01
"""Largest relative difference from the requested value at which it is reached."""
ROUNDS = 4
"""Largest number of confirming runs at the point predicted by the surfaces. Each run is added to the
surfaces."""
EQUAL_POINTS = 1e-6
"""Points of the unit box with a smaller distance than this are one run."""
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
    unit: str
    """Unit as written; empty for a plain number."""
    levels: int = 5

    @classmethod
    def of(cls, text: str) -> "Varied":
        """The quantity of a text such as "striker.speed=4 m/s:7 m/s:5".

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
        """A value as written in the file."""
        rounded = float(f"{value:.{DIGITS}g}")
        return f"{rounded:.{DIGITS}g} {self.unit}" if self.unit else rounded


@dataclass(frozen=True)
class Scan:
    """Predictions over a grid of quantities."""

    varied: tuple[Varied, ...]
    points: FloatArray
    """Values in the units of `varied`, shape [n, d]."""
    numbers: tuple[Numbers, ...]
    """Results of each point."""

    def column(self, name: str) -> FloatArray:
        """One number at every point, shape [n]."""
        return np.array([getattr(one, name) for one in self.numbers])


@dataclass(frozen=True)
class Aim:
    """The point closest to the requested results, confirmed by a run at this point."""

    wanted: dict[str, float]
    at: dict[str, float]
    """Values of the quantities, in their units."""
    numbers: Numbers
    """Results of the run at this point."""
    distance: float
    """Largest relative difference from a requested result [-]."""
    at_bound: tuple[str, ...]
    """Quantities at a bound of their range."""

    @property
    def reached(self) -> bool:
        """True if every result agrees within `CLOSE`."""
        return self.distance <= AIM_TOLERANCE


def varied_test(test: PlannedTest, values: Mapping[str, float | str]) -> PlannedTest:
    """The test with other values of some keys.

    The checks are those of its file.

    Raises InputError if a key does not exist, or if a value is not allowed.
    """
    file = test.file.varied(values)
    return PlannedTest(file, file.validated(TestFile))


def scan(
    test: PlannedTest, varied: Sequence[Varied], *, progress: Callable[[int, int], None] = lambda n, m: None
) -> Scan:
    """Predict the test over a full factorial design, with the specimen's static curve.

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
    """The point of a scan's box with the requested results.

    It is found by response surfaces through the scan and by confirming runs.

    ``test``: the test as declared. ``wanted``: numbers of `NAMES` and their requested values, SI. Raises
    ValueError if a name is unknown, if a requested value is not positive, or if too few points have that
    result.
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
    """Largest relative distance from a requested number; infinite if one is unknown."""
    away = [abs(getattr(found, name) / value - 1.0) for name, value in wanted.items()]
    return float(max(away)) if np.isfinite(away).all() else math.inf


def _promised(
    box: Box, points: FloatArray, numbers: Sequence[Numbers], wanted: Mapping[str, float]
) -> FloatArray:
    """Point at which the surfaces through the results are closest to the requested ones."""
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


EVENTS = {
    "incident_rise": "incident wave arrives at the flyer",
    "striker_parts": "striker separates",
    "tensile_dip": "joint is pulled",
    "separation": "flyer separates",
    "arrest": "flyer is arrested",
    "push_back": "specimen pushes it back",
    "second_impact": "second impact on the incident bar",
}
"""Events in words."""
EVERY = 1e-6
"""Time between two rows of the signals [s]."""


def signals(found: Prediction) -> dict[str, Any]:
    """Signals of bars, flyer and specimen as named columns, SI. Names contain the units."""
    bars, test = found.bars, found.test.declared
    step = max(1, round(EVERY / float(bars.times[1])))
    every = slice(None, None, step)
    flyer = next(iter(test.flyer.values()))
    return {
        "time (s)": bars.times[every],
        "incident bar, middle (N)": bars.incident.force(0.5 * test.incident.length)[every],
        "striker on shaper (N)": bars.shaper_force[every],
        "shaper compression (m)": bars.shaper_approach[every],
        "joint (N)": bars.joint_force[every],
        "joint gap (m)": bars.joint_gap[every],
        "flyer's first part, middle (N)": bars.flyer.force(0.5 * flyer.length)[every],
        "force on flyer (N)": bars.force_flyer[every],
        "force on transmission platen (N)": bars.force_transmission[every],
        "transmitted, at the sensor (N)": bars.transmission.force(found.test.sensor_depth())[every],
        "incident bar's end (m/s)": bars.incident.velocity(test.incident.length)[every],
        "flyer (m/s)": bars.flyer_velocity[every],
        "flyer (m)": bars.flyer_path[every],
        "transmission platen (m)": bars.support_path[every],
        "compression (1)": (bars.compression / test.specimen.length)[every],
    }


def events_table(found: Prediction) -> dict[str, Any]:
    """Events with their time and the state of flyer and specimen."""
    bars, length = found.bars, found.test.declared.specimen.length
    named = {words: getattr(found.events, name) for name, words in EVENTS.items()}
    known = {words: time for words, time in named.items() if np.isfinite(time)}
    at = np.round(np.array(list(known.values())) / bars.times[1]).astype(int)
    return {
        "event": list(known),
        "time (s)": list(known.values()),
        "flyer (m/s)": bars.flyer_velocity[at],
        "compression (1)": bars.compression[at] / length,
        "transmitted force (N)": bars.force_transmission[at],
    }


def scan_table(found: Scan) -> dict[str, Any]:
    """One row per point of a scan."""
    columns: dict[str, Any] = {
        f"{one.key} ({one.unit or '1'})": found.points[:, i] for i, one in enumerate(found.varied)
    }
    return columns | {f"{field.name} (SI)": found.column(field.name) for field in fields(Numbers)}


def to_json(found: Prediction, scanned: Scan | None = None, aimed: Aim | None = None) -> dict[str, Any]:
    """All results except the histories as one JSON object in SI units. Unknown values are null."""
    said: dict[str, Any] = {
        "test": found.test.declared.name,
        "events": vars(found.events),
        "numbers": vars(found.numbers),
        "specimen": "static curve" if found.response is None else "finite elements",
        "passes": len(found.changes),
        "warnings": doubts(found),
    }
    if scanned is not None:
        said["scan"] = scan_table(scanned)
    if aimed is not None:
        said["aim"] = {**vars(aimed), "numbers": vars(aimed.numbers), "reached": aimed.reached}
    made: dict[str, Any] = jsonable(said, "prediction")
    return made


def tables(found: Prediction, scanned: Scan | None = None, aimed: Aim | None = None) -> dict[str, Any]:
    """Signals and events. With finite elements, also the outline at every recorded time. For a scan, its
    points."""
    made = {"signals": signals(found), "events": events_table(found)}
    response = found.response
    if response is not None:
        n, k = response.surface_r.shape[1:]
        made["outline"] = {
            "time (s)": np.repeat(response.surface_times, k),
            "node": np.tile(np.arange(k), n),
            "r (m)": response.surface_r[0].ravel(),
            "y (m)": response.surface_y[0].ravel(),
        }
    return made if scanned is None else {**made, "scan": scan_table(scanned)}


LARGEST_RECORDED = 0.6
"""Largest nominal compression of the virtual shot [-], as in Mates et al. (2012)."""
SHARE_OF_LARGEST = 0.95
"""Share of the largest compression, used if it is smaller. The flyer then still moves toward the specimen."""


def write_specification(folder: Path, found: Prediction) -> Path:
    """Write `virtual.toml`, a specification of a virtual test.

    The flyer's path is written into the same folder.

    Specimen, material and interface are those of the test file. One bar of their total length replaces the
    parts behind the specimen. It has the steel of the last part.

    Raises ValueError if the flyer does not move.
    """
    bars, test = found.bars, found.test.declared
    moved = np.flatnonzero(bars.flyer_path > MOVES)
    if not moved.size:
        raise ValueError("the flyer does not move before the end of [run] duration")
    first, every = max(int(moved[0]) - 1, 0), max(1, round(KNOT / float(bars.times[1])))
    until = found.events.arrest if isfinite(found.events.arrest) else float(bars.times[-1])
    keep = slice(first, max(round(until / float(bars.times[1])), first + 4 * every) + 1, every)
    path = bars.flyer_path[keep] - bars.flyer_path[first]
    write_table(folder / MOTION, {"time (s)": bars.times[keep] - bars.times[first], "displacement (m)": path})
    largest = min(LARGEST_RECORDED, SHARE_OF_LARGEST * found.numbers.largest_strain)
    parts, m = list(test.transmission.values()), test.material
    material = si_texts(
        m, "law", "parameters", "shear_modulus", "stiffness_factor", "poisson", "damping", "mass_damping"
    )
    tables: dict[str, dict[str, Any]] = {
        "specimen": si_texts(test.specimen, "diameter", "length", "density"),
        "material": material,
        **({} if test.relaxation is None else {"relaxation": relaxation_table(test.relaxation)}),
        "interface": si_texts(test.interface, "faces", "side", "friction"),
        "transmission": {"support": "bar"},
        "transmission.bar": {
            **si_texts(parts[-1], "diameter"),
            "length": f"{sum(part.length for part in parts):.9g} m",
            **si_texts(parts[-1], *STEEL),
        },
        "motion": {"kind": "sampled", "file": MOTION, "compression": f"{100.0 * largest:.4g} %"},
    }
    head = (
        "# The predicted test for the virtual laboratory: kolsky virtual make virtual.toml --out SHOT\n"
        "# The flyer's path is that of the prediction; others have the defaults of `kolsky virtual new`.\n"
    )
    file = folder / "virtual.toml"
    file.write_text(toml_text(tables, name=test.name, head=head), encoding="utf-8")
    return file
