"""Fit Bergstrom and Boyce's network to uniaxial histories at several rates.

The law of network A is that of the slowest test times a free factor. The exponent C of the chains' creep and
the stretch xi are held: the range of strains of one specimen hardly tells them from the resistance.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from explicit.relaxation import BergstromBoyce, bergstrom_boyce_stress
from kolsky.base.arrays import FloatArray
from kolsky.material.relaxation.evidence import HistoryTest, ScaledLaw

NAMES = ("factor", "ratio", "resistance", "exponent")
"""The free parameters: on network A [-], s [-], tau_hat [Pa] and m [-]."""
RANGES = {"factor": (1e-3, 1e3), "ratio": (1e-3, 1e3), "exponent": (1.0, 30.0)}
"""Their allowed ranges; that of the resistance is 1e-4 to 1e4 times the shear modulus."""
DIFFERENCE = 1e-3
"""Half of the central difference in a logarithm; the histories are integrated to 1e-8."""


@dataclass(frozen=True)
class CreepFit:
    """A fitted network."""

    factor: float
    """Factor on the law of network A; network B's stress has it too [-]."""
    network: BergstromBoyce
    """Network B."""
    values: FloatArray
    """The parameters in the order of `NAMES`, shape [4]."""
    covariance: FloatArray
    """Covariance of their logarithms, widened where chi-square asks for it [-], shape [4, 4]."""
    chi_square: float
    """Weighted sum of squared residuals [-]."""
    n_data: int
    """Values with a finite sigma."""
    at_bound: tuple[str, ...]
    """Parameters at the end of their range: the tests do not determine them."""

    @property
    def aic(self) -> float:
        """Akaike's criterion [-], to compare with `kolsky.material.relaxation.rate_fit.RateFit.aic`."""
        return self.chi_square + 2.0 * len(NAMES)


def fit_bergstrom_boyce(
    law: Any,
    tests: Sequence[HistoryTest],
    *,
    start: BergstromBoyce | None = None,
    chain_exponent: float = -0.5,
    first_creep: float = 0.05,
    max_evaluations: int = 60,
) -> CreepFit:
    """Fit factor, ratio, resistance and exponent to all tests at once."""
    known = [np.isfinite(test.sigma) for test in tests]
    n_data = sum(int(k.sum()) for k in known)
    if n_data <= len(NAMES):
        raise ValueError(f"{len(NAMES)} parameters need more than {len(NAMES)} measured values, got {n_data}")
    mu = float(law.initial_shear_modulus)
    begin = start or BergstromBoyce(0.5, 0.5 * mu, 4.0)
    ranges = {**RANGES, "resistance": (1e-4 * mu, 1e4 * mu)}
    lower, upper = np.log(np.array([ranges[name] for name in NAMES])).T

    def residuals(x: FloatArray) -> FloatArray:
        factor, network = _network(x, chain_exponent, first_creep)
        rows = []
        for test, wanted in zip(tests, known, strict=True):
            # Only the law scales: the resistance is a stress of its own.
            scaled = ScaledLaw(law, factor)
            stress = bergstrom_boyce_stress(scaled, network, test.time, test.stretch)[0]
            rows.append(((stress - test.stress) / test.sigma)[wanted])
        return np.concatenate(rows)

    def jacobian(x: FloatArray) -> FloatArray:
        shifts = DIFFERENCE * np.eye(len(x))
        columns = [(residuals(x + s) - residuals(x - s)) / (2.0 * DIFFERENCE) for s in shifts]
        return np.stack(columns, axis=1)

    x = np.log([1.0, begin.ratio, begin.resistance, begin.exponent])
    inner = (lower + 2.0 * DIFFERENCE, upper - 2.0 * DIFFERENCE)
    found = least_squares(
        residuals, np.clip(x, inner[0] + 1e-6, inner[1] - 1e-6), jac=jacobian, bounds=inner,
        x_scale=1.0, max_nfev=max_evaluations,
    )  # fmt: skip
    chi_square = float(found.fun @ found.fun)
    widened = max(1.0, chi_square / (n_data - len(NAMES)))
    factor, network = _network(found.x, chain_exponent, first_creep)
    ends = (found.x - inner[0] < 1e-3) | (inner[1] - found.x < 1e-3)
    return CreepFit(
        factor=factor,
        network=network,
        values=np.exp(found.x),
        covariance=np.asarray(np.linalg.pinv(found.jac.T @ found.jac) * widened, dtype=np.float64),
        chi_square=chi_square,
        n_data=n_data,
        at_bound=tuple(name for name, end in zip(NAMES, ends, strict=True) if end),
    )


def _network(x: FloatArray, chain_exponent: float, first_creep: float) -> tuple[float, BergstromBoyce]:
    factor, ratio, resistance, exponent = np.exp(x).tolist()
    return factor, BergstromBoyce(ratio, resistance, exponent, chain_exponent, first_creep)
