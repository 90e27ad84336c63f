"""Stress and moduli at fixed strains: the quasi-static curve times each shot's stiffness factor."""

from collections.abc import Sequence

import numpy as np

from kolsky.forward import material_law
from kolsky.rates.records import QuasiStatic, StiffnessAtStrain, TestedShot

STEP = 1e-4
"""Half step of the tangent's central difference [-]; its error is of the order of 1e-8 of the curvature."""
QUANTITIES = ("nominal stress", "secant modulus", "tangent modulus", "apparent modulus")


def stiffness_at(shots: Sequence[TestedShot], strain: float) -> StiffnessAtStrain | None:
    """Stress and moduli of the shots that reached a strain; None if there is none, or no curve reaches it.

    Parameters
    ----------
    shots
        Counted shots of one group.
    strain
        Nominal compressive strain, 0 to below 1; at 0 there is the tangent modulus alone.

    Raises
    ------
    ValueError
        If the strain is outside [0, 1).
    """
    if not 0.0 <= strain < 1.0:
        raise ValueError(f"a nominal compressive strain must be in [0, 1), got {strain:g}")
    reached = [s for s in shots if s.history.largest >= strain and reaches(s.quasi_static, strain)]
    if not reached:
        return None
    at = [curve_at(shot.quasi_static, strain) for shot in reached]
    names = list(at[0])
    m = np.array([shot.m for shot in reached])
    sigma = np.array([shot.sigma for shot in reached])
    values = {name: np.array([one[name][0] for one in at]) for name in names}
    own = {name: np.array([one[name][1] for one in at]) for name in names}
    return StiffnessAtStrain(
        strain=strain,
        shots=tuple(shot.name for shot in reached),
        rates=np.array([shot.history.nominal_rate for shot in reached]),
        quantities={n: (m * values[n], np.hypot(sigma * values[n], m * own[n])) for n in names},
        baseline=at[0],
    )


def reaches(baseline: QuasiStatic, strain: float) -> bool:
    """Whether the curve was measured as far as this compressive strain, by the measure of Marlow's law."""
    stretch = 1.0 - strain
    return bool(np.sqrt(stretch**2 + 2.0 / stretch - 3.0) <= material_law(baseline.curve).data_limit)


def curve_at(baseline: QuasiStatic, strain: float) -> dict[str, tuple[float, float]]:
    """The baseline's stress and moduli at a compressive strain, through the law that the solver uses.

    Returns
    -------
    dict
        Of `QUANTITIES`, value and standard uncertainty [Pa]; at zero strain of the tangent modulus alone. The
        apparent modulus is Eq. (M.9), 3 stress / (lambda^-2 - lambda).
    """
    law = material_law(baseline.curve)

    def stress(e: float) -> float:
        stretch = 1.0 - e
        tau = law.stress(np.array([1.0 / stretch, stretch**2, 0.0, 1.0 / stretch]))
        return float(tau[0] - tau[1]) / stretch

    share = _relative_sigma(baseline, strain)
    # The slope of a curve with independent points is known less well than its height; the points' own
    # relative sigma is the height's, and the factor m has the larger uncertainty in either.
    tangent = (stress(strain + STEP) - stress(strain - STEP)) / (2.0 * STEP)
    found = {"tangent modulus": tangent}
    if strain > 0.0:
        stretch = 1.0 - strain
        height = stress(strain)
        found = {
            "nominal stress": height,
            "secant modulus": height / strain,
            **found,
            "apparent modulus": 3.0 * height / (stretch**-2.0 - stretch),
        }
    return {name: (value, share * value) for name, value in found.items()}


def _relative_sigma(baseline: QuasiStatic, strain: float) -> float:
    """The curve's relative standard deviation near a strain, interpolated in s = sqrt(I1 - 3)."""
    curve = baseline.curve
    kept = curve.stress != 0.0
    stretch = curve.stretch[kept]
    s = np.sqrt(np.maximum(stretch**2 + 2.0 / stretch - 3.0, 0.0))
    order = np.argsort(s)
    wanted = np.sqrt((1.0 - strain) ** 2 + 2.0 / (1.0 - strain) - 3.0)
    relative = curve.sigma[kept] / np.abs(curve.stress[kept])
    return float(np.interp(wanted, s[order], relative[order]))
