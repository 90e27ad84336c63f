"""Stress and moduli at fixed strains: the quasi-static curve times each shot's stiffness factor."""

from collections.abc import Sequence

import numpy as np

from explicit.materials import MaterialLaw
from kolsky.inverse.forward import curve_replicates, material_law
from kolsky.studies.rates.records import QuasiStatic, RatedShot, StiffnessAtStrain

STEP = 1e-4
"""Half step of the tangent's central difference [-]; its error is of the order of 1e-8 of the curvature."""
DRAWS = 100
"""Curves drawn from the curve's own noise; a standard deviation of so many is known to 7 %."""
Quantities = dict[str, tuple[float, float]]


class Baselines:
    """The laws of some quasi-static curves with their replicates, each made once."""

    def __init__(self) -> None:
        self._laws: dict[str, list[MaterialLaw]] = {}

    def reaches(self, baseline: QuasiStatic, strain: float) -> bool:
        """True if the curve was measured as far as this compressive strain, as Marlow's law measures it."""
        return _measure(strain) <= self._of(baseline)[0].data_limit

    def at(self, baseline: QuasiStatic, strain: float) -> Quantities:
        """The baseline's stress and moduli at a compressive strain, through the law that the solver uses.

        Returns
        -------
        dict
            Nominal stress, secant, tangent and apparent modulus, value and standard uncertainty [Pa]; at zero
            strain the tangent modulus alone. The apparent modulus is Eq. (M.9), 3 stress / (lambda^-2 -
            lambda). The uncertainty is the scatter of curves drawn from the noise of the curve's points: the
            tangent is known less well than the stress.
        """
        drawn = [_quantities(law, strain) for law in self._of(baseline)]
        return {
            name: (value, float(np.std([one[name] for one in drawn[1:]], ddof=1)))
            for name, value in drawn[0].items()
        }

    def stress(self, baseline: QuasiStatic, strain: float) -> float:
        """Nominal compressive stress [Pa]."""
        return _stress(self._of(baseline)[0], strain)

    def _of(self, baseline: QuasiStatic) -> list[MaterialLaw]:
        if baseline.source not in self._laws:
            drawn = curve_replicates(baseline.curve, DRAWS, np.random.default_rng(1))
            self._laws[baseline.source] = [material_law(baseline.curve), *drawn]
        return self._laws[baseline.source]


def stiffness_at(shots: Sequence[RatedShot], strain: float, baselines: Baselines) -> StiffnessAtStrain | None:
    """Stress and moduli of the shots that reached a strain; None if there is none, or no curve reaches it.

    Parameters
    ----------
    shots
        Counted shots of one group.
    strain
        Nominal compressive strain, 0 to below 1; at 0 there is the tangent modulus alone.
    baselines
        The laws of their curves.

    Raises
    ------
    ValueError
        If the strain is outside [0, 1).
    """
    if not 0.0 <= strain < 1.0:
        raise ValueError(f"a nominal compressive strain must be in [0, 1), got {strain:g}")
    reached = [s for s in shots if s.history.largest >= strain and baselines.reaches(s.quasi_static, strain)]
    if not reached:
        return None
    at = [baselines.at(shot.quasi_static, strain) for shot in reached]
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


def _measure(strain: float) -> float:
    """s = sqrt(I1 - 3) of an isochoric uniaxial compression."""
    stretch = 1.0 - strain
    return float(np.sqrt(max(stretch**2 + 2.0 / stretch - 3.0, 0.0)))


def _stress(law: MaterialLaw, strain: float) -> float:
    """Nominal compressive stress of an isochoric uniaxial compression [Pa]."""
    stretch = 1.0 - strain
    tau = law.stress(np.array([1.0 / stretch, stretch**2, 0.0, 1.0 / stretch]))
    return float(tau[0] - tau[1]) / stretch


def _quantities(law: MaterialLaw, strain: float) -> dict[str, float]:
    tangent = (_stress(law, strain + STEP) - _stress(law, strain - STEP)) / (2.0 * STEP)
    if strain == 0.0:
        return {"tangent modulus": tangent}
    stretch, height = 1.0 - strain, _stress(law, strain)
    return {
        "nominal stress": height,
        "secant modulus": height / strain,
        "tangent modulus": tangent,
        "apparent modulus": 3.0 * height / (stretch**-2.0 - stretch),
    }
