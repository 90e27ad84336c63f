"""Comparison of laws fitted to the same tests: goodness of fit, uncertainty, Drucker's stability.

A material is stable if d tau : d eps > 0 for every step (Drucker 1959), with the Kirchhoff stress and the
logarithmic strain. In the principal axes of an incompressible solid, the steps are those with d eps_1 + d
eps_2 + d eps_3 = 0. The criterion is therefore that H of Eq. (L.2) is positive definite in that plane: both
of its eigenvalues are > 0 (as in Abaqus, Theory Manual 4.6). The criterion is stricter than a nominal stress
that increases with stretch. A law may have an increasing uniaxial curve and be unstable in a lateral
direction.

Uniaxial compression is equibiaxial tension and the reverse. Planar compression is planar tension with renamed
axes. All are listed because a user searches for the actual test.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum

import numpy as np

from dic.views import ResultViews
from explicit.materials import LAWS, AnyLaw
from explicit.materials.law import Stretches, logarithmic_hessian, tangent
from explicit.materials.volumetric import VolumetricLaw
from kolsky.base.arrays import FloatArray
from kolsky.material.fits.fit import STARTS, Fit, FitOutcome, fit_law
from kolsky.material.fits.homogeneous import Mode, free_stretches
from kolsky.material.fits.homogeneous_test import HomogeneousTest
from kolsky.material.fits.search import Weighting

POINTS = 2000
"""Number of deformations checked between rest and the end of a path, equally spaced in ln(stretch)."""
_COMPRESSIBLE_POINTS = 100
"""The same for a compressible solid. Its lateral stretch must be computed at each deformation."""
_ACROSS = np.array([0.0, 1.0, -1.0]) / np.sqrt(2.0)
_ALONG = np.array([2.0, -1.0, -1.0]) / np.sqrt(6.0)
"""Two volume-preserving steps, without and with the first axis."""


class Stability(Enum):
    """Outcome of a path."""

    STABLE = "stable"
    """Stable to the end of the checked path."""
    UNSTABLE = "unstable"
    """Beyond some strain, a strain step has zero or negative work."""
    UNDEFINED = "not defined"
    """Beyond some strain the law has no energy: it locks at this strain."""


@dataclass(frozen=True)
class PathStability:
    """One mode in one direction, beginning at rest."""

    mode: Mode
    direction: str
    """ "tension", "compression" or "shear"."""
    outcome: Stability
    strain: float
    """Nominal strain (or amount of shear) at which stability is lost, or the end of the path [-]."""

    def __str__(self) -> str:
        name = "simple shear" if self.mode is Mode.SIMPLE_SHEAR else f"{self.mode.value} {self.direction}"
        if self.outcome is Stability.STABLE:
            return f"{name}: stable to {self.strain:.4g}"
        return f"{name}: {self.outcome.value} from {self.strain:.4g}"


def least_compressible_stiffness(
    law: Stretches, volume: VolumetricLaw, mode: Mode, deformation: FloatArray
) -> FloatArray:
    """Smallest eigenvalue of d tau / d eps over all steps of a compressible solid with stress-free sides
    [Pa].

    d tau_i / d eps_j is Eq. (L.2) with J U' + J^2 U'' added to every entry; shape [...]. It is NaN if no
    lateral stretch leaves the sides without stress.
    """
    d = np.asarray(deformation, dtype=float)
    found = np.full(d.shape, np.nan)
    for place in np.ndindex(d.shape):  # one by one: past a limit point the next have no solution
        try:
            lam = np.stack(free_stretches(law, volume, mode, d[place]))
        except ValueError:
            continue
        J = float(lam.prod())
        whole = tangent(law, lam) + float(J * volume.pressure(J) + J**2 * volume.stiffness(J))
        if np.isfinite(whole).all():
            found[place] = np.linalg.eigvalsh(0.5 * (whole + whole.T))[0]
    return found


def least_stiffness(law: Stretches, mode: Mode, deformation: FloatArray) -> FloatArray:
    """Smallest eigenvalue of d tau / d eps in the plane of constant volume [Pa], shape [...].

    NaN if the law is not defined.
    """
    lam = np.stack(np.broadcast_arrays(*mode.principal_stretches(deformation)), axis=-1)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        H = logarithmic_hessian(law, lam)
        # Steps without strain along the stiffest axis must not be a small difference of large numbers.
        first = np.argmax(np.nan_to_num(np.diagonal(H, axis1=-2, axis2=-1), nan=0.0), axis=-1)
        axes = (first[..., None] + np.arange(3)) % 3
        H = np.take_along_axis(np.take_along_axis(H, axes[..., :, None], -2), axes[..., None, :], -1)
        a, b, c = (
            np.einsum("i,...ij,j->...", u, H, v)
            for u, v in ((_ACROSS, _ACROSS), (_ACROSS, _ALONG), (_ALONG, _ALONG))
        )
        largest = 0.5 * (a + c) + np.hypot(0.5 * (a - c), b)
        return np.where(largest > 0.0, a * (c / largest) - b * (b / largest), a + c - largest)


def drucker(
    law: Stretches, *, most: float = 10.0, volume: VolumetricLaw | None = None
) -> tuple[PathStability, ...]:
    """The strain at which a law becomes unstable, in every mode."""
    if not 1.0 < most < float("inf"):
        raise ValueError(f"most must be > 1 and finite, got {most}")
    modes = ((Mode.UNIAXIAL, 1.0), (Mode.EQUIBIAXIAL, 0.5), (Mode.PLANAR, 1.0))
    ends = [(mode, float(most ** (side * reach))) for mode, reach in modes for side in (1.0, -1.0)]
    ends.append((Mode.SIMPLE_SHEAR, most - 1.0 / most))
    return tuple(_path(law, *end, volume) for end in ends)


def stable_over(
    law: Stretches, tests: Sequence[HomogeneousTest], *, volume: VolumetricLaw | None = None
) -> tuple[PathStability, ...]:
    """Stability of a law, or of the compressible solid, from rest to the ends of tests in each direction."""
    ends = [(test.mode, float(end)) for test in tests for end in np.sort(test.deformation)[[0, -1]]]
    return tuple(_path(law, *end, volume) for end in ends if abs(end[1] - end[0].at_rest) >= 1e-9)


def _path(law: Stretches, mode: Mode, end: float, volume: VolumetricLaw | None) -> PathStability:
    """The path from rest to an end, equally spaced in ln(stretch)."""
    if mode is Mode.SIMPLE_SHEAR:
        direction, way = "shear", 2.0 * np.sinh(np.linspace(0.0, np.arcsinh(0.5 * end), POINTS))
    else:
        direction = "tension" if end > 1.0 else "compression"
        way = np.exp(np.linspace(0.0, np.log(end), POINTS))

    def stiffness(at: FloatArray) -> FloatArray:
        if volume is None or mode is Mode.SIMPLE_SHEAR:  # which keeps the volume
            return least_stiffness(law, mode, at)
        return least_compressible_stiffness(law, volume, mode, at)

    if volume is not None:
        way = way[:: len(way) // _COMPRESSIBLE_POINTS]
    least = stiffness(way)
    bad = np.flatnonzero(~(least > 0.0))
    if not bad.size:
        return PathStability(mode, direction, Stability.STABLE, float(mode.strain(way[-1])))
    first = int(bad[0])
    outcome = Stability.UNSTABLE if np.isfinite(least[first]) else Stability.UNDEFINED
    low, high = float(way[max(first - 1, 0)]), float(way[first])
    for _ in range(60):  # bisection: the criterion may have no sign change, as where a law locks
        middle = 0.5 * (low + high)
        if stiffness(np.array([middle]))[0] > 0.0:
            low = middle
        else:
            high = middle
    return PathStability(mode, direction, outcome, float(mode.strain(high)))


FARTHEST = 10.0
"""Smallest principal stretch up to which stability is checked [-]."""


@dataclass(frozen=True)
class Candidate:
    """A law to be fitted."""

    name: str
    law: type[AnyLaw]
    held: Mapping[str, float] = field(default_factory=dict)
    """Constants that are not fitted, SI."""


@dataclass(frozen=True)
class Row:
    """One law of a comparison."""

    candidate: Candidate
    fit: Fit | None
    """The fit; None if there is none."""
    stability: tuple[PathStability, ...]
    """Drucker's criterion in every mode, far beyond the data; empty without a fit."""
    over_data: tuple[PathStability, ...]
    """Drucker's criterion from rest to the ends of the tests."""
    reason: str = ""

    @property
    def stable(self) -> bool:
        """True if there is a fit and it is stable from rest to the ends of all tests."""
        return self.fit is not None and all(path.outcome is Stability.STABLE for path in self.over_data)

    @property
    def first_failure(self) -> PathStability | None:
        """The path that loses stability at the smallest logarithmic strain. None if all paths are stable."""
        failed = [path for path in self.stability if path.outcome is not Stability.STABLE]
        return min(failed, key=_remoteness, default=None)


@dataclass(frozen=True)
class Comparison(ResultViews):
    """Laws fitted to the same tests with the same weights."""

    tests: tuple[HomogeneousTest, ...]
    weighting: Weighting
    bounded: bool
    """True if the constants were kept in the range of positive energy at any deformation."""
    poisson: float | None
    """Poisson's ratio at rest; None for the incompressible solution."""
    rows: tuple[Row, ...]
    """The laws, least AIC first. Those without a fit are last."""

    @property
    def best(self) -> Row | None:
        """Smallest BIC of a law stable over the data with constants that the data determine, or None."""
        doubtful = (FitOutcome.NOT_DETERMINED, FitOutcome.UNCONFIRMED)
        usable = [row for row in self.rows if row.stable and row.fit and row.fit.outcome not in doubtful]
        return min(usable, key=lambda row: row.fit.bic if row.fit else np.inf, default=None)


def candidates(names: Sequence[str] = ()) -> tuple[Candidate, ...]:
    """The laws of these names, all if none is given.

    A law's name means the law with all of its constants, as in every command. Two more names have some
    constants 0: "mooney_rivlin_2" is mooney_rivlin with C10 and C01, "mooney_rivlin_c20" is polynomial with
    C10, C01 and C20.

    Raises ValueError if a name is unknown.
    """
    known = {name: Candidate(name, law) for name, law in LAWS.items()}
    known["mooney_rivlin_2"] = Candidate("mooney_rivlin_2", LAWS["mooney_rivlin"], {"C11": 0.0})
    squares = {"C11": 0.0, "C02": 0.0}
    known["mooney_rivlin_c20"] = Candidate("mooney_rivlin_c20", LAWS["polynomial"], squares)
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
    """Fit every law and check its stability.

    The row of a law that cannot be fitted gives the reason.

    Raises ValueError if there is no law or no test.

    Parameters
    ----------
    laws
        The laws to fit, see `candidates`.
    tests, weighting, bounded, poisson, free_poisson, starts, seed
        See `kolsky.material.fits.fit.fit_law`.
    progress
        Called with the number of laws done.
    """
    if not laws or not tests:
        raise ValueError(f"a comparison needs laws and tests, got {len(laws)} and {len(tests)}")
    weighting = Weighting(weighting)
    stretches = [np.stack(test.mode.principal_stretches(test.deformation)) for test in tests]
    reach = max(FARTHEST, *(float(max(lam.max(), 1.0 / lam.min())) for lam in stretches))
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
        volume = None if found.poisson is None else VolumetricLaw(found.bulk_modulus)
        everywhere = drucker(found.law, most=reach, volume=volume)
        rows.append(Row(candidate, found, everywhere, stable_over(found.law, tests, volume=volume)))
    progress(len(laws))
    rows.sort(key=lambda row: np.inf if row.fit is None else row.fit.aic)
    return Comparison(tuple(tests), weighting, bounded, poisson, tuple(rows))


def _remoteness(path: PathStability) -> float:
    """Largest principal logarithmic strain at the end of a path [-], under any name of its deformation."""
    lam = np.stack(path.mode.principal_stretches(path.mode.at_rest + path.strain))
    return round(float(np.abs(np.log(lam)).max()), 9)
