"""The sources of error of a budget, and realisations: a test with errors, made and estimated again."""

import hashlib
import json
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError
from scipy.stats import norm, qmc

from dic.files import regular
from doe import Box
from doe.ledger import Run
from kolsky.base.arrays import FloatArray
from kolsky.base.errors import InputError
from kolsky.base.files import source_hash
from kolsky.inverse.coarse_search import on_edge
from kolsky.inverse.gauss_newton import Step, gauss_newton_step
from kolsky.inverse.problem import DEFAULT, InverseProblem
from kolsky.inverse.runner import Runner
from kolsky.inverse.search import search_shot
from kolsky.inverse.settings import Settings
from kolsky.inverse.work import Work
from kolsky.shot.input_records import Input
from kolsky.shot.inputs import INPUTS
from kolsky.shot.load import load_shot
from kolsky.shot.records import Shot
from kolsky.virtual.make import write_shot
from kolsky.virtual.schema import Specification
from kolsky.virtual.specification import ShotSpecification
from kolsky.virtual.truth import Truth, TruthError, simulate_truths

NOISE = "noise"
"""The factor without a key: new random streams of all instruments."""


def _in_laboratory(key: str) -> Input | None:
    """The input that corresponds to a key of a specification of synthetic tests."""
    return next((one for one in INPUTS.values() if one.laboratory and one.laboratory.key == key), None)


def usual_sizes() -> dict[str, str | float]:
    """Standard uncertainties of a careful laboratory, used if a specification has no [budget]."""
    sources = [one.laboratory for one in INPUTS.values() if one.laboratory is not None]
    return {one.key: one.usual for one in sorted(sources, key=lambda one: one.order) if one.usual is not None}


@dataclass(frozen=True)
class Factor:
    """One source of error."""

    key: str
    """Dotted key of the specification, or `NOISE`."""
    sigma: float
    """Standard uncertainty of its value, SI; 1 for the noise."""

    @property
    def words(self) -> str:
        """Description; for an unknown key, the key itself."""
        if self.key == NOISE:
            return "noise of all instruments"
        one = _in_laboratory(self.key)
        return self.key if one is None or one.laboratory is None else one.laboratory.words or one.words

    @property
    def shared(self) -> bool:
        """True if one error is common to all shots of a campaign. Otherwise each shot has a new draw."""
        one = _in_laboratory(self.key)
        return one is not None and one.shared != "" and not (one.laboratory and one.laboratory.anew)


def factors_of(sizes: Mapping[str, Any]) -> tuple[Factor, ...]:
    """Factors from their keys and written-out standard uncertainties, the noise first.

    ``sizes``: dotted key -> value as in the specification: a text with a unit, or a plain number.
    """
    found = [Factor(NOISE, 1.0)]
    for key, written in sizes.items():
        table, _, name = key.partition(".")
        try:
            made = Specification.model_validate({table: {name: written}})
        except ValidationError as error:
            said = error.errors()[0]
            raise ValueError(f"{key} = {written!r}: {said['msg']}") from None
        value = getattr(getattr(made, table), name)
        if isinstance(value, bool) or not isinstance(value, int | float) or not value > 0.0:
            raise ValueError(
                f"{key} = {written!r} is not a standard uncertainty; it must be a number above 0"
            )
        found.append(Factor(key, float(value)))
    return tuple(found)


def shifted(quantities: Specification, errors: Mapping[str, float]) -> Specification:
    """The specification with errors added to some of its values, SI."""
    for key, error in errors.items():
        table, _, name = key.partition(".")
        section = getattr(quantities, table)
        section = section.model_copy(update={name: getattr(section, name) + error})
        quantities = quantities.model_copy(update={table: section})
    return quantities


NODES = np.array([-np.sqrt(3.0), 0.0, np.sqrt(3.0)])
WEIGHTS = np.array([1.0, 4.0, 1.0]) / 6.0
"""Gauss-Hermite rule of three points for a standard normal variable: exact for polynomials up to degree 5."""


def slopes_of(factors: tuple[Factor, ...], alone: list[Run], columns: int) -> FloatArray:
    """Changes of the re-fits by one standard uncertainty of each source, shape [k, columns]. The change is
    zero for the noise, and for a source with a node that gave no answer. ``alone``: runs of `design` from row
    1 on."""
    found = np.zeros((len(factors), columns))
    for i in range(1, len(factors)):
        low, high = alone[2 * i - 1 : 2 * i + 1]
        if low.completed and high.completed:
            change = (high.results[:columns] - low.results[:columns]) / (NODES[2] - NODES[0])
            found[i] = np.nan_to_num(change)
    return found


def design(factors: tuple[Factor, ...], *, draws: int, together: int, seed: int) -> FloatArray:
    """Errors of every realisation in standard uncertainties, and a flag for the complete search, [n, k + 1].

    Rows 0 and 1 have no errors; row 0 uses the complete search. Then follow two nodes of each factor except
    the noise. Draws of the noise alone follow, numbered from 1. The last rows have all errors together: a
    Latin hypercube of normal values with separate noise draws. They use the complete search.
    """
    k = len(factors)
    nodes, noise = np.zeros((2 * (k - 1), k + 1)), np.zeros((draws, k + 1))
    nodes[np.arange(2 * (k - 1)), np.repeat(np.arange(1, k), 2)] = np.tile(NODES[[0, 2]], k - 1)
    noise[:, 0] = np.arange(1, draws + 1)
    rows = [np.eye(k + 1)[k:], np.zeros((1, k + 1)), nodes, noise]
    if together:
        normal = norm.ppf(qmc.LatinHypercube(k, seed=seed).random(together))
        normal[:, 0] = draws + 1.0 + np.arange(together)
        rows.append(np.column_stack([normal, np.ones(together)]))
    return np.concatenate(rows)


SAME_VALLEY = 3.0
"""A complete search is in the same valley if it ends within this many standard deviations of the re-fit."""
MOST_STEPS = 16
"""Maximum number of steps of a re-fit."""
AT_REST = 0.1
"""A re-fit has converged if its next step is shorter than this, in standard deviations from the residuals.
The budget is computed from differences of re-fits."""
LONGEST = 0.02
"""Longest step of a coordinate, as a share of the edge of its design. A longer step could cross a ridge."""
OUT_OF_STEP = 0.08
"""A re-fit has left its valley if `phase` changes by more than this. A change of m / (1 - 2 nu) by 8 %
changes the ringing period by 4 %. At the end of a test of ten oscillations this is a third of one."""
FIRST_DIFFERENCE = 2e-3
"""Half step of the first differences, as a share of the edge of the design; later half a standard
deviation."""


class RealisationOutcome(StrEnum):
    """Outcome of one realisation of a test with errors."""

    REFITTED = "re-fitted"
    """By the re-fit only, as requested."""
    SAME_VALLEY = "same valley"
    """The complete search ends in the same valley as the re-fit."""
    OTHER_VALLEY = "another valley"
    """Outcome if the complete search ends in another local minimum. An automatic answer would jump to this
    minimum."""
    SEARCHED = "searched"
    """Only the complete search was made: for the test without errors, or if the response is too rough for a
    re-fit."""
    SEARCH_REFUSED = "search refused"
    """The re-fit has an answer, but the complete search has none."""
    LEFT_VALLEY = "left the valley"
    """The re-fit left the valley: it moved until the ringing was out of phase by a third of an oscillation or
    more."""
    NOT_AT_REST = "not at rest"
    """The re-fit did not converge."""
    AT_BOUND = "at a bound"
    """The re-fit ended at a bound of its parameters."""
    REFUSED = "refused"
    """The test gave no answer."""

    @property
    def counted(self) -> bool:
        """True if a standard deviation includes the realisation's estimate."""
        return self not in (self.LEFT_VALLEY, self.NOT_AT_REST, self.AT_BOUND, self.REFUSED)


@dataclass(frozen=True)
class Estimate:
    """The estimate of one realisation."""

    values: Mapping[str, float]
    """Free parameters, SI."""
    sigma: Mapping[str, float]
    """Their standard deviations from the residuals."""
    outcome: RealisationOutcome


def whole_search(shot: Shot, settings: Settings) -> Estimate:
    """The optimum of `kolsky.identify`, with uncertainties from the residuals alone."""
    found = search_shot(InverseProblem.of(shot, settings), Work())
    names = found.problem.box.names
    return Estimate(
        dict(zip(names, found.fine.x.tolist(), strict=True)),
        dict(zip(names, found.fine.sigma.tolist(), strict=True)),
        RealisationOutcome.SEARCHED,
    )


def refit(shot: Shot, settings: Settings, start: Mapping[str, float]) -> Estimate:
    """The optimum next to a start, on the refined mesh, with the weights of `whole_search`.

    The path of the flyer is not changed, as with `settings.replicates` of 0. ``settings``: as for the
    complete search; the parameters in `start` are free. ``start``: free parameters and their initial values,
    SI. Raises ValueError if no run at the start completes.
    """
    free = {name: (settings.free or {}).get(name) for name in start}
    problem = InverseProblem.of(shot, replace(settings, free=free))
    box, runner = problem.box, Runner.of(problem, Work())
    first = np.clip([start[name] for name in box.names], box.lower, box.upper)
    x, step = _downhill(runner, box, first)
    outcome = RealisationOutcome.REFITTED
    if step.moved > AT_REST:
        outcome = RealisationOutcome.NOT_AT_REST
    elif on_edge(x, box).any():
        outcome = RealisationOutcome.AT_BOUND
    elif abs(phase(box.as_dict(x)) - phase(box.as_dict(first))) > OUT_OF_STEP:
        outcome = RealisationOutcome.LEFT_VALLEY
    return Estimate(
        dict(zip(box.names, x.tolist(), strict=True)),
        dict(zip(box.names, step.sigma.tolist(), strict=True)),
        outcome,
    )


def _downhill(runner: Runner, box: Box, x: FloatArray) -> tuple[FloatArray, Step]:
    """Gauss-Newton steps with slopes on the refined mesh, each no longer than `LONGEST`."""
    edge = np.array(box.upper) - np.array(box.lower)
    half, share, before = FIRST_DIFFERENCE * edge, 1.0, np.zeros(len(x))
    for _ in range(MOST_STEPS):
        h = np.diag(half)
        up, down = np.minimum(x + h, box.upper), np.maximum(x - h, box.lower)
        runs = runner.run("check", np.vstack([x, up, down]), runner.problem.refined)
        prediction = runs.prediction
        if prediction is None or len(runs.rows) < 2 * len(x) + 1:
            raise ValueError("the re-fit needs every run next to its point to complete")
        objective = runner.objective(np.asarray(prediction.inside.all(axis=0)), slowly=True)
        vectors, d = objective.vectors(prediction), len(x)
        slope = (vectors[1 : d + 1] - vectors[d + 1 :]).T / (up - down).sum(axis=1)
        step = gauss_newton_step(objective, slope, vectors[0], x, box)
        if step.moved <= AT_REST:
            return x + step.change, step
        back = float(before / step.sigma @ (step.change / step.sigma))
        if back < 0.0:
            share *= 0.5  # the steps oscillate
        before = step.change
        x = x + np.clip(share * step.change, -LONGEST * edge, LONGEST * edge)
        half = np.clip(0.5 * step.sigma, 0.1 * FIRST_DIFFERENCE * edge, FIRST_DIFFERENCE * edge)
    return x, step


def phase(values: Mapping[str, float]) -> float:
    """Logarithm of m / (1 - 2 nu), which determines the ringing period [-]. Only free parameters
    contribute."""
    m, nu = values.get("stiffness_factor", 1.0), values.get("poisson", 0.0)
    return float(np.log(m) - np.log(1.0 - 2.0 * nu))


def same_valley(near: Estimate, whole: Estimate) -> bool:
    """True if the complete search agrees with the re-fit in every parameter that is free in both."""
    common = near.values.keys() & whole.values.keys()
    return all(
        abs(near.values[name] - whole.values[name]) <= SAME_VALLEY * whole.sigma[name] for name in common
    )


TRUE_TABLES = ("specimen", "material", "relaxation", "interface", "transmission", "motion", "frames", "truth")
"""Tables that change the true test."""
TRUE_KEYS = ("tilt", "off_centre", "slip_friction", "trigger")
"""Imperfections that change the true test."""


KEPT = 4
"""Number of truths kept in memory. It includes the unchanged test."""


@dataclass(frozen=True)
class Realisations:
    """A test as a function of its errors, for `doe.ledger.run_chunks`. It can be pickled. A point contains
    the error of each factor in standard uncertainties. For the noise, it contains the number of its draw. The
    last entry is 1 if the complete search is made in addition to the re-fit, otherwise 0."""

    quantities: Specification
    """The test without errors."""
    folder: Path
    """Folder of the files that it names."""
    factors: tuple[Factor, ...]
    settings: Settings
    start: Mapping[str, float] | None = None
    """The optimum of the test without errors, which is the start of the re-fits. None: every realisation uses
    the complete search. It follows from the other fields and is not part of `model_hash`."""
    slopes: FloatArray | None = None
    """Changes of the parameters of `columns_of` by one standard uncertainty of each source, shape [k, c].
    They shift the start of a realisation with several sources. None: not yet known."""

    def __call__(self, points: FloatArray) -> Sequence[Run]:
        """Realise the points, shape [n, k + 1]. Every run contains the re-fit's estimates of `columns_of`,
        then those of the complete search. Missing estimates are NaN."""
        return [self._one(point) for point in points]

    def _one(self, point: FloatArray) -> Run:
        sizes, whole = point[:-1], point[-1]
        pairs = zip(self.factors[1:], sizes[1:], strict=True)
        errors = {factor.key: float(z) * factor.sigma for factor, z in pairs if z != 0.0}
        try:
            quantities = shifted(self.quantities, errors)
            truth = self._truth(quantities)
            start = self._start(sizes)
            return self._identified(quantities, truth, int(sizes[0]), start, whole=bool(whole))
        except (InputError, TruthError, ValueError) as error:
            return _run(RealisationOutcome.REFUSED, self.settings, None, None, _first_line(error))

    def _start(self, sizes: FloatArray) -> Mapping[str, float] | None:
        """Start of the re-fit: the optimum without errors plus the linear shift by each error, [k]."""
        if self.start is None or self.slopes is None:
            return self.start
        moved = sizes @ self.slopes  # those of the noise are 0
        places = dict(zip(columns_of(self.settings), moved.tolist(), strict=True))
        return {name: value + places[name] for name, value in self.start.items()}

    def _identified(
        self,
        quantities: Specification,
        truth: Truth,
        draw: int,
        start: Mapping[str, float] | None,
        *,
        whole: bool,
    ) -> Run:
        """The estimates of a synthetic shot, from its files."""
        made = ShotSpecification(draw, quantities.name, {}, quantities, self.folder)
        with tempfile.TemporaryDirectory(prefix="kolsky-budget-") as place:
            write_shot(made, truth, Path(place) / "shot")
            shot = load_shot(Path(place) / "shot")
            if start is None:
                found = whole_search(shot, self.settings)
                return _run(found.outcome, self.settings, None, found)
            near = refit(shot, self.settings, start)
            if not near.outcome.counted:
                return _run(near.outcome, self.settings, near, None, f"the re-fit ended {near.outcome}")
            if not whole:
                return _run(near.outcome, self.settings, near, None)
            try:
                found = whole_search(shot, self.settings)
            except (InputError, ValueError) as error:
                outcome = RealisationOutcome.SEARCH_REFUSED
                return _run(outcome, self.settings, near, None, _first_line(error))
            valley = same_valley(near, found)
            outcome = RealisationOutcome.SAME_VALLEY if valley else RealisationOutcome.OTHER_VALLEY
            return _run(outcome, self.settings, near, found)

    def _truth(self, quantities: Specification) -> Truth:
        numerics = self.settings.numerics
        return _truth(_true_part(quantities), self.folder, numerics.device, numerics.threads)

    def model_hash(self) -> bytes:
        """SHA-256 of all inputs of a realisation except its errors."""
        numerics, name = replace(self.settings.numerics, threads=None), self.quantities.motion.file
        motion = None if name is None else regular(self.folder / name).read_bytes()
        said = {
            "quantities": self.quantities.model_dump(mode="json"),
            "factors": [asdict(factor) for factor in self.factors],
            "settings": asdict(replace(self.settings, numerics=numerics)),
            "motion": None if motion is None else hashlib.sha256(motion).hexdigest(),
            "sources": source_hash(),
        }
        return hashlib.sha256(json.dumps(said, sort_keys=True, default=str).encode()).digest()


def _true_part(quantities: Specification) -> Specification:
    """The specification without instrument and declaration settings. Equal truths have equal ones."""
    bare = Specification()
    tables = {name: getattr(quantities, name) for name in TRUE_TABLES}
    wrong = quantities.imperfections
    kept = bare.imperfections.model_copy(update={key: getattr(wrong, key) for key in TRUE_KEYS})
    delay = bare.transmitted.model_copy(update={"delay": quantities.transmitted.delay})
    return bare.model_copy(update={**tables, "imperfections": kept, "transmitted": delay})


def _truth(true: Specification, folder: Path, device: str, threads: int | None) -> Truth:
    """The truth of a specification. The last few are cached, because most realisations share theirs."""
    key = f"{folder} {true.model_dump_json()}"
    if key not in _TRUTHS:
        while len(_TRUTHS) >= KEPT:
            del _TRUTHS[next(iter(_TRUTHS))]
        _TRUTHS[key] = simulate_truths([true], folder=folder, device=device, threads=threads)[0]
    return _TRUTHS[key]


_TRUTHS: dict[str, Truth] = {}


def _run(
    outcome: RealisationOutcome,
    settings: Settings,
    near: Estimate | None,
    whole: Estimate | None,
    reason: str = "",
) -> Run:
    names = columns_of(settings)
    rows = [
        [np.nan if one is None else one.values.get(name, np.nan) for name in names] for one in (near, whole)
    ]
    return Run(outcome.counted, outcome.value, np.array(rows, dtype=np.float64).ravel(), reason)


def _first_line(error: Exception) -> str:
    return str(error).splitlines()[0][:500]


def columns_of(settings: Settings) -> tuple[str, ...]:
    """Parameters in a realisation's record: those of `names_of`, then others that may be free."""
    names = names_of(settings)
    return names + tuple(name for name in DEFAULT if name not in names and settings.free is None)


def names_of(settings: Settings) -> tuple[str, ...]:
    """Parameters with a budget: those declared free. Without a declaration, the stiffness factor."""
    return ("stiffness_factor",) if settings.free is None else tuple(settings.free)
