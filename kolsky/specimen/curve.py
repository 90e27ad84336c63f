"""The fitted law as a reference curve: what `identify` reads as [curve] or [law] of a shot.

The uniaxial curve is that of the incompressible law, as a shot file's [law] has it too. The uncertainty of
the constants moves all its points together: its columns "mode 1 ..." are c(lambda) = dT/dp L, with L L^T the
covariance of the constants.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from explicit.materials import LAWS, AnyLaw
from kolsky.base.arrays import FloatArray
from kolsky.specimen.constants import COUPLED, POISSON, YEOH_D, YOUNG, Constants

POINTS = 41
"""Points of the curve, rest included."""
DIFFERENCE = 1e-5
"""Relative step of the slopes by the constants."""


@dataclass(frozen=True)
class LawCurve:
    """Nominal stress over nominal strain of a fitted law."""

    branch: Literal["tension", "compression"]
    """Which side of rest."""
    strain: FloatArray
    """Nominal, tension positive [-], shape [n]."""
    stress: FloatArray
    """Nominal, tension positive [Pa], shape [n]."""
    modes: FloatArray
    """Standard deviations that move all points together [Pa], shape [modes, n]."""

    @property
    def sigma(self) -> FloatArray:
        """Standard uncertainty of each stress [Pa], shape [n]."""
        return np.asarray(np.sqrt((self.modes**2).sum(axis=0)))


def incompressible_law(constants: Constants, free: FloatArray) -> AnyLaw:
    """The law of `explicit.materials` with these constants; the coupled one becomes neo-Hookean."""
    values = constants.all(free)
    if constants.law == COUPLED:
        return LAWS["neo_hookean"].of([values[YOUNG] / (2.0 * (1.0 + values[POISSON]))])
    kind = LAWS["yeoh" if constants.law == YEOH_D else constants.law]
    return kind.of([values[spec.name] for spec in kind.PARAMETERS])


def uniaxial_stress(law: AnyLaw, stretch: FloatArray) -> FloatArray:
    """Nominal stress of the incompressible law under uniaxial load [Pa], shape [n]."""
    slope, side, _ = law.principal(stretch, stretch**-0.5, stretch**-0.5)
    return np.asarray(slope - side * stretch**-1.5)


def law_curve(
    constants: Constants,
    covariance: FloatArray,
    *,
    branch: Literal["tension", "compression"],
    largest_strain: float,
) -> LawCurve:
    """The curve of a fitted law with the uncertainty of its constants.

    Parameters
    ----------
    constants
        The fitted law.
    covariance
        Of its free constants, SI, shape [p, p]; not finite where they are not known, then the curve has no
        modes of its own.
    branch, largest_strain
        Side, and the largest nominal strain, > 0 and in compression < 1.
    """
    end = 1.0 + largest_strain if branch == "tension" else 1.0 - largest_strain
    stretch = np.linspace(1.0, end, POINTS)
    free = constants.start
    stress = uniaxial_stress(incompressible_law(constants, free), stretch)
    if not np.isfinite(covariance).all():
        return LawCurve(branch, stretch - 1.0, stress, np.zeros((0, POINTS)))
    values, vectors = np.linalg.eigh(covariance)
    slopes = []
    for j in range(len(free)):
        step = DIFFERENCE * max(abs(free[j]), 1e-3 * constants.scales[j])
        moved = free.copy()
        moved[j] += step
        slopes.append((uniaxial_stress(incompressible_law(constants, moved), stretch) - stress) / step)
    modes = (vectors * np.sqrt(np.maximum(values, 0.0))).T @ np.array(slopes)
    kept = np.abs(modes).max(axis=1) > 0.0
    return LawCurve(branch, stretch - 1.0, stress, modes[kept])


def shot_lines(curve: LawCurve, file: str) -> str:
    """The lines of a shot.toml that make the curve its [curve]."""
    lines = [
        "[curve]",
        f'file = "{file}"',
        'strain = { column = "strain", unit = "1" }',
        'stress = { column = "stress (Pa)", unit = "Pa" }',
        'convention = "tension positive"',
        f'branch = "{curve.branch}"',
    ]
    if len(curve.modes):
        lines.append('modes = { prefix = "mode", unit = "Pa" }')
    else:
        lines.append('relative_sigma = ""  # fill in: the constants have no covariance')
    return "\n".join(lines) + "\n"
