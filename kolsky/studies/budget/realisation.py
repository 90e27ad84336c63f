"""One realisation of a budget: a whole test made with chosen errors, and identified."""

import hashlib
import json
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from doe.ledger_rows import Run
from kolsky.base.arrays import FloatArray
from kolsky.base.errors import InputError
from kolsky.base.files import regular, source_hash
from kolsky.inverse.free_parameters import DEFAULT
from kolsky.inverse.settings import Settings
from kolsky.shot.load import load_shot
from kolsky.studies.budget.factors import NOISE, Factor, shifted
from kolsky.studies.budget.refit import Estimate, RealisationOutcome, refit, same_valley, whole_search
from kolsky.virtual.records import Truth
from kolsky.virtual.schema import Specification
from kolsky.virtual.shot_folder import write_shot
from kolsky.virtual.specification import ShotSpecification
from kolsky.virtual.truth import TruthError, simulate_truths

TRUE_TABLES = ("specimen", "material", "relaxation", "interface", "transmission", "motion", "frames", "truth")
"""Tables that change what the test truly did."""
TRUE_KEYS = ("tilt", "off_centre", "slip_friction", "trigger")
"""Imperfections that do."""


KEPT = 4
"""Truths that are kept in memory, the unchanged test among them."""


@dataclass(frozen=True)
class Realisations:
    """A test as a function of its errors, for `doe.executors.run_chunks`; it can be pickled.

    A point holds, for each factor, its error in standard uncertainties, of the noise the number of its draw;
    and last whether the whole search is asked for beside the re-fit, 1 or 0.
    """

    quantities: Specification
    """The test without errors."""
    folder: Path
    """Where files are that it names."""
    factors: tuple[Factor, ...]
    """Sources of error, length k."""
    settings: Settings
    """How each realisation is identified."""
    start: Mapping[str, float] | None = None
    """The optimum of the test without errors, where re-fits begin; None: everything is searched whole. It
    follows from the rest, and is no part of `model_hash`."""
    slopes: FloatArray | None = None
    """Changes of the parameters of `columns_of` by one standard uncertainty of each source, which move the
    start of a realisation of several sources, shape [k, c]; None: not known yet."""

    def __call__(self, points: FloatArray) -> Sequence[Run]:
        """Realise the points, shape [n, k + 1]; of every run the re-fit's estimates of `columns_of`, then the
        whole search's, NaN where there is none."""
        return [self._one(point) for point in points]

    def _one(self, point: FloatArray) -> Run:
        *sizes, whole = point
        errors = {
            factor.key: float(z) * factor.sigma
            for factor, z in zip(self.factors, sizes, strict=True)
            if factor.key != NOISE and z != 0.0
        }
        draw = next((int(z) for factor, z in zip(self.factors, sizes, strict=True) if factor.key == NOISE), 0)
        try:
            quantities = shifted(self.quantities, errors)
            truth = self._truth(quantities)
            start = self._start(np.array(sizes))
            return self._identified(quantities, truth, draw, start, whole=bool(whole))
        except (InputError, TruthError, ValueError) as error:
            return _run(RealisationOutcome.REFUSED, self.settings, None, None, _first_line(error))

    def _start(self, sizes: FloatArray) -> Mapping[str, float] | None:
        """Where the re-fit begins: the optimum without errors, moved by what each error moves it, [k]."""
        if self.start is None or self.slopes is None:
            return self.start
        noise = [factor.key == NOISE for factor in self.factors]
        moved = np.where(noise, 0.0, sizes) @ self.slopes
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
        """The estimates of a made shot, through its files."""
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

    def _motion_file(self) -> str | None:
        """SHA-256 of the sampled motion that the test names."""
        name = self.quantities.motion.file
        return None if name is None else hashlib.sha256(regular(self.folder / name).read_bytes()).hexdigest()

    def model_hash(self) -> bytes:
        """SHA-256 of all that a realisation depends on but its errors."""
        numerics = replace(self.settings.numerics, threads=None)
        said = {
            "quantities": self.quantities.model_dump(mode="json"),
            "factors": [asdict(factor) for factor in self.factors],
            "settings": asdict(replace(self.settings, numerics=numerics)),
            "motion": self._motion_file(),
            "sources": source_hash(),
        }
        return hashlib.sha256(json.dumps(said, sort_keys=True, default=str).encode()).digest()


def _true_part(quantities: Specification) -> Specification:
    """The specification without what only instruments and the shot file see: the same truth has the same."""
    bare = Specification()
    tables = {name: getattr(quantities, name) for name in TRUE_TABLES}
    wrong = quantities.imperfections
    kept = bare.imperfections.model_copy(update={key: getattr(wrong, key) for key in TRUE_KEYS})
    delay = bare.transmitted.model_copy(update={"delay": quantities.transmitted.delay})
    return bare.model_copy(update={**tables, "imperfections": kept, "transmitted": delay})


def _truth(true: Specification, folder: Path, device: str, threads: int | None) -> Truth:
    """The truth of a specification; the last few are kept, for most realisations share one."""
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
    """Parameters that a realisation's record has room for: those of `names_of`, then what may be free too."""
    names = names_of(settings)
    return names + tuple(name for name in DEFAULT if name not in names and settings.free is None)


def names_of(settings: Settings) -> tuple[str, ...]:
    """Parameters that a budget is made for: those declared free, or the stiffness factor."""
    return ("stiffness_factor",) if settings.free is None else tuple(settings.free)
