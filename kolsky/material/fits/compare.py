"""Comparison of laws fitted to the same tests: goodness of fit, stability, uncertainty."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from explicit.materials import LAWS, AnyLaw
from explicit.materials.volumetric import VolumetricLaw
from kolsky.material.fits.fit import STARTS, Fit, FitOutcome, fit_law
from kolsky.material.fits.homogeneous_test import HomogeneousTest
from kolsky.material.fits.residuals import Weighting
from kolsky.material.fits.stability import PathStability, Stability, drucker, stable_over

FARTHEST = 10.0
"""Principal stretch to which stability is followed at least [-]."""


@dataclass(frozen=True)
class Candidate:
    """A law to be tried."""

    name: str
    """Name in tables."""
    law: type[AnyLaw]
    """The law."""
    held: Mapping[str, float] = field(default_factory=dict)
    """Constants that are not fitted, SI."""


@dataclass(frozen=True)
class Row:
    """One law of a comparison."""

    candidate: Candidate
    """Law and held constants."""
    fit: Fit | None
    """The fit; None if there is none."""
    stability: tuple[PathStability, ...]
    """Drucker's criterion in every mode, far beyond the data; empty without a fit."""
    over_data: tuple[PathStability, ...]
    """The same from rest to the ends of the tests."""
    reason: str = ""
    """Why there is no fit."""

    @property
    def stable(self) -> bool:
        """True if there is a fit and it is stable from rest to the ends of all tests."""
        return self.fit is not None and all(path.outcome is Stability.STABLE for path in self.over_data)

    @property
    def first_failure(self) -> PathStability | None:
        """The path that loses stability at the smallest logarithmic strain; None if all are stable."""
        failed = [path for path in self.stability if path.outcome is not Stability.STABLE]
        return min(failed, key=_remoteness, default=None)


@dataclass(frozen=True)
class Comparison:
    """Laws fitted to the same tests with the same weights."""

    tests: tuple[HomogeneousTest, ...]
    """The tests."""
    weighting: Weighting
    """Divisor of the residuals."""
    bounded: bool
    """True if the constants were kept where the energy is positive at any deformation."""
    poisson: float | None
    """Poisson's ratio at rest; None for the incompressible solution."""
    rows: tuple[Row, ...]
    """The laws, least AIC first, those without a fit last."""

    @property
    def best(self) -> Row | None:
        """Least BIC among the laws whose constants the data determine and that are stable over the data.

        None if there is none.
        """
        usable = [row for row in self.rows if row.stable and row.fit is not None]
        doubtful = (FitOutcome.NOT_DETERMINED, FitOutcome.UNCONFIRMED)
        usable = [row for row in usable if row.fit and row.fit.outcome not in doubtful]
        return min(usable, key=lambda row: row.fit.bic if row.fit else np.inf, default=None)


def candidates(names: Sequence[str] = ()) -> tuple[Candidate, ...]:
    """The laws of these names, all if none is given.

    Beside the laws' own names: "mooney_rivlin" has its two constants, "mooney_rivlin_c11" the mixed term too,
    and "mooney_rivlin_c20" is the polynomial with the square of I1 - 3 alone.

    Raises
    ------
    ValueError
        If a name is not known.
    """
    known = _known()
    for name in names:
        if name not in known:
            raise ValueError(f"law {name!r} is not one of {', '.join(known)}")
    return tuple(known[name] for name in names or known)


def compare_laws(
    laws: Sequence[Candidate],
    tests: Sequence[HomogeneousTest],
    *,
    weighting: Weighting = Weighting.ABSOLUTE,
    bounded: bool = True,
    poisson: float | None = None,
    free_poisson: bool = False,
    starts: int = STARTS,
    seed: int = 1,
    progress: Callable[[int], None] = lambda done: None,
) -> Comparison:
    """Fit every law and judge its stability; a law that cannot be fitted has a row that says why.

    Parameters
    ----------
    laws
        What to try, see `candidates`.
    tests, weighting, bounded, poisson, free_poisson, starts, seed
        See `kolsky.material.fits.fit.fit_law`.
    progress
        Called with the number of laws done.

    Raises
    ------
    ValueError
        If there is no law or no test.
    """
    if not laws or not tests:
        raise ValueError(f"a comparison needs laws and tests, got {len(laws)} and {len(tests)}")
    rows = []
    for done, candidate in enumerate(laws):
        progress(done)
        try:
            found = fit_law(
                candidate.law,
                tests,
                weighting=weighting,
                bounded=bounded,
                held=candidate.held,
                poisson=poisson,
                free_poisson=free_poisson,
                starts=starts,
                seed=seed,
                name=candidate.name,
            )
        except ValueError as error:
            rows.append(Row(candidate, None, (), (), str(error)))
            continue
        reach = max(FARTHEST, *(_farthest(test) for test in tests))
        volume = None if found.poisson is None else VolumetricLaw(found.bulk_modulus)
        rows.append(
            Row(
                candidate,
                found,
                drucker(found.law, most=reach, volume=volume),
                stable_over(found.law, tests, volume=volume),
            )
        )
    progress(len(laws))
    rows.sort(key=lambda row: np.inf if row.fit is None else row.fit.aic)
    return Comparison(tuple(tests), weighting, bounded, poisson, tuple(rows))


def _farthest(test: HomogeneousTest) -> float:
    lam = np.stack(test.mode.principal_stretches(test.deformation))
    return float(max(lam.max(), 1.0 / lam.min()))


def _known() -> dict[str, Candidate]:
    made = {name: Candidate(name, law) for name, law in LAWS.items()}
    made["mooney_rivlin"] = Candidate("mooney_rivlin", LAWS["mooney_rivlin"], {"C11": 0.0})
    made["mooney_rivlin_c11"] = Candidate("mooney_rivlin_c11", LAWS["mooney_rivlin"])
    squares = {"C11": 0.0, "C02": 0.0}
    made["mooney_rivlin_c20"] = Candidate("mooney_rivlin_c20", LAWS["polynomial"], squares)
    return made


def _remoteness(path: PathStability) -> float:
    """Largest size of a principal logarithmic strain at the end of a path [-], the same for one deformation
    under two names."""
    lam = np.stack(path.mode.principal_stretches(path.mode.at_rest + path.strain))
    return round(float(np.abs(np.log(lam)).max()), 9)
