r"""Drucker's stability of a law: the strain at which a small step of stress would lower the strain's work.

A material is stable where d tau : d eps > 0 for every step (Drucker 1959), with the Kirchhoff stress and the
logarithmic strain. In the principal axes of an incompressible solid the steps are those with d eps_1 +
d eps_2 + d eps_3 = 0, so the criterion is that H of Eq. (L.2) is positive definite in that plane,
both of its eigenvalues > 0 (as in Abaqus, Theory Manual 4.6). It says more than that a nominal stress rises
with its stretch: a law may have a rising uniaxial curve and be unstable across it.

Uniaxial compression is equibiaxial tension and the reverse, and planar compression is planar tension with the
axes named anew; all are listed because a user looks for the test that was made.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np

from explicit.materials.law import Stretches
from explicit.materials.principal import tangent
from explicit.materials.volumetric import VolumetricLaw
from kolsky.base.arrays import FloatArray
from kolsky.material.fits.homogeneous import free_stretches
from kolsky.material.fits.homogeneous_test import HomogeneousTest
from kolsky.material.fits.modes import Mode

POINTS = 2000
"""Deformations looked at between rest and the end of a path, equal in ln(stretch)."""
COMPRESSIBLE_POINTS = 100
"""The same of a compressible solid, whose lateral stretch has to be searched at each."""
_ACROSS = np.array([0.0, 1.0, -1.0]) / np.sqrt(2.0)
_ALONG = np.array([2.0, -1.0, -1.0]) / np.sqrt(6.0)
"""Two steps that keep the volume, without and with the first axis."""


class Stability(Enum):
    """Outcome of a path."""

    STABLE = "stable"
    """To the end of the path that was looked at."""
    UNSTABLE = "unstable"
    """From a strain on a step of strain does no work, or negative."""
    UNDEFINED = "not defined"
    """From a strain on the law has no energy: it locks there."""


@dataclass(frozen=True)
class PathStability:
    """One mode in one direction, from rest outward."""

    mode: Mode
    """The test."""
    direction: str
    """ "tension", "compression" or "shear"."""
    outcome: Stability
    """Outcome of the path."""
    strain: float
    """Nominal strain (or amount of shear) where stability is lost, or the end of the path [-]."""

    def __str__(self) -> str:
        name = "simple shear" if self.mode is Mode.SIMPLE_SHEAR else f"{self.mode.value} {self.direction}"
        if self.outcome is Stability.STABLE:
            return f"{name}: stable to {self.strain:.4g}"
        return f"{name}: {self.outcome.value} from {self.strain:.4g}"


def least_compressible_stiffness(
    law: Stretches, volume: VolumetricLaw, mode: Mode, deformation: FloatArray
) -> FloatArray:
    """Least eigenvalue of d tau / d eps over all steps of a compressible solid with stress-free sides [Pa].

    d tau_i / d eps_j is Eq. (L.2) with J U' + J^2 U'' added to every entry; shape [...], NaN where no lateral
    stretch leaves the sides without stress.
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
    """Least eigenvalue of d tau / d eps in the plane that keeps the volume [Pa], shape [...]; NaN where the
    law is not defined.

    Raises
    ------
    ValueError
        If a stretch is not > 0.
    """
    lam = np.stack(np.broadcast_arrays(*mode.principal_stretches(deformation)), axis=-1)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        w = np.stack(law.principal(lam[..., 0], lam[..., 1], lam[..., 2]), axis=-1) * lam
        H = law.hessian(lam[..., 0], lam[..., 1], lam[..., 2]) * lam[..., :, None] * lam[..., None, :]
        H = H + np.eye(3) * w[..., None]
        # Steps that leave the stiffest axis as it is must not be the small difference of large numbers.
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
    """The strain at which a law stops being stable, in every mode.

    Parameters
    ----------
    law
        The strain energy.
    most
        Principal stretch at which a path ends, > 1 [-]; likewise 1 / most. So equibiaxial paths end at its
        root, and simple shear at most - 1 / most.
    volume
        The volumetric law of a compressible solid, whose sides are without stress along its paths and whose
        steps may change the volume; incompressible if not given.

    Raises
    ------
    ValueError
        If `most` is not > 1.
    """
    if not 1.0 < most < float("inf"):
        raise ValueError(f"most must be > 1 and finite, got {most}")
    log = np.linspace(0.0, np.log(most), POINTS)
    paths = []
    for mode, reach in ((Mode.UNIAXIAL, 1.0), (Mode.EQUIBIAXIAL, 0.5), (Mode.PLANAR, 1.0)):
        paths.append(_path(law, mode, "tension", np.exp(reach * log), volume))
        paths.append(_path(law, mode, "compression", np.exp(-reach * log), volume))
    paths.append(_path(law, Mode.SIMPLE_SHEAR, "shear", 2.0 * np.sinh(log), volume))
    return tuple(paths)


def stable_over(
    law: Stretches, tests: Sequence[HomogeneousTest], *, volume: VolumetricLaw | None = None
) -> tuple[PathStability, ...]:
    """Stability of a law from rest to the ends of tests; a path for each test and direction. With a
    volumetric law the paths are those of the compressible solid.

    Raises
    ------
    ValueError
        If a test has a stretch that is not > 0.
    """
    paths = []
    for test in tests:
        rest = test.mode.at_rest
        for end in (float(test.deformation.min()), float(test.deformation.max())):
            if abs(end - rest) < 1e-9:
                continue
            direction = "tension" if end > rest else "compression"
            if test.mode is Mode.SIMPLE_SHEAR:
                direction, way = "shear", 2.0 * np.sinh(np.linspace(0.0, np.arcsinh(0.5 * end), POINTS))
            else:
                way = np.exp(np.linspace(0.0, np.log(end), POINTS))
            paths.append(_path(law, test.mode, direction, way, volume))
    return tuple(paths)


def _path(
    law: Stretches, mode: Mode, direction: str, way: FloatArray, volume: VolumetricLaw | None = None
) -> PathStability:
    def stiffness(at: FloatArray) -> FloatArray:
        if volume is None or mode is Mode.SIMPLE_SHEAR:  # which keeps the volume
            return least_stiffness(law, mode, at)
        return least_compressible_stiffness(law, volume, mode, at)

    if volume is not None:
        way = way[:: len(way) // COMPRESSIBLE_POINTS]
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
