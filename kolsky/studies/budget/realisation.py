"""One realisation of a budget: a whole test made with chosen errors, and identified."""

import hashlib
import json
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from doe.ledger import Run
from kolsky.base.arrays import FloatArray
from kolsky.base.errors import InputError
from kolsky.inverse.prepared_shot import prepare_shot
from kolsky.inverse.search import search_shot
from kolsky.inverse.settings import Settings
from kolsky.shot.load import load_shot
from kolsky.shot.records import Shot
from kolsky.studies.budget.factors import NOISE, Factor, shifted
from kolsky.studies.sweep import source_hash
from kolsky.virtual.records import Truth
from kolsky.virtual.schema import Specification
from kolsky.virtual.shot_folder import write_shot
from kolsky.virtual.specification import ShotSpecification
from kolsky.virtual.truth import TruthError, simulate_truths

TRUE_TABLES = ("specimen", "material", "interface", "transmission", "motion", "frames", "truth")
"""Tables that change what the test truly did."""
TRUE_KEYS = ("tilt", "off_centre", "slip_friction", "trigger")
"""Imperfections that do."""


KEPT = 4
"""Truths that are kept in memory, the unchanged test among them."""


@dataclass(frozen=True)
class Realisations:
    """A test as a function of its errors, for `doe.executors.run_chunks`; it can be pickled.

    A point holds, for each factor, its error in standard uncertainties; of the noise, the number of its draw.
    """

    quantities: Specification
    """The test without errors."""
    folder: Path
    """Where files are that it names."""
    factors: tuple[Factor, ...]
    """Sources of error, length k."""
    settings: Settings
    """How each realisation is identified."""

    def __call__(self, points: FloatArray) -> Sequence[Run]:
        """Realise the points, shape [n, k]; every run is the estimates, in the order of `names_of`."""
        return [self._one(point) for point in points]

    def _one(self, point: FloatArray) -> Run:
        errors = {
            factor.key: float(z) * factor.sigma
            for factor, z in zip(self.factors, point, strict=True)
            if factor.key != NOISE and z != 0.0
        }
        draw = next((int(z) for factor, z in zip(self.factors, point, strict=True) if factor.key == NOISE), 0)
        nothing = np.full(len(names_of(self.settings)), np.nan)
        try:
            quantities = shifted(self.quantities, errors)
            truth = self._truth(quantities)
            return Run(True, "identified", _identified(quantities, truth, draw, self.folder, self.settings))
        except (InputError, TruthError, ValueError) as error:
            return Run(False, "refused", nothing, str(error).splitlines()[0][:500])

    def _truth(self, quantities: Specification) -> Truth:
        numerics = self.settings.numerics
        return _truth(_true_part(quantities), self.folder, numerics.device, numerics.threads)

    def _motion_file(self) -> str | None:
        """SHA-256 of the sampled motion that the test names."""
        name = self.quantities.motion.file
        return None if name is None else hashlib.sha256((self.folder / name).read_bytes()).hexdigest()

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


def _identified(
    quantities: Specification, truth: Truth, draw: int, folder: Path, settings: Settings
) -> FloatArray:
    """The estimates of a made shot, through its files, shape [n_free]."""
    shot = ShotSpecification(draw, quantities.name, {}, quantities, folder)
    with tempfile.TemporaryDirectory(prefix="kolsky-budget-") as place:
        write_shot(shot, truth, Path(place) / "shot")
        return estimate(load_shot(Path(place) / "shot"), settings)


def estimate(shot: Shot, settings: Settings) -> FloatArray:
    """The optimum of `kolsky.identify` alone, without its uncertainty, in the order of `names_of`.

    Raises
    ------
    ValueError
        As `kolsky.identify`.
    """
    found = search_shot(prepare_shot(shot), settings, lambda stage, done, total: None)
    place = {name: i for i, name in enumerate(found.stages.box.names)}
    return np.array([found.fine.x[place[name]] for name in names_of(settings)], dtype=np.float64)


def names_of(settings: Settings) -> tuple[str, ...]:
    """Parameters that a budget is made for: those declared free, or the stiffness factor."""
    return ("stiffness_factor",) if settings.free is None else tuple(settings.free)
