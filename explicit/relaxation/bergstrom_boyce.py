r"""Bergstrom and Boyce's network: a second chain network that creeps, beside the elastic one.

Network A is the material law as it stands. Network B is the same law times a ratio s, on the elastic part of
F_bar = F_e F_v; its Kirchhoff stress is tau_B = s tau_W(b_e) with b_e = F_e F_e^T. It flows by
(Bergstrom and Boyce 1998, Eqs. 26-32; the rate of 1 / s is taken out of their product of constants)

    D_v = gamma N,   N = tau_B / |tau_B|,
    gamma = (1 / s) (lam_v - 1 + xi)^C (|tau_B| / tau_hat)^m,   lam_v = sqrt(tr b_v / 3),              (V.3)

with |.| the Frobenius norm. C lies in [-1, 0]: the further the chains have crept, the slower they creep; xi
keeps the first creep finite. All of network B's power that is not stored is dissipated, |tau_B| gamma >= 0.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from explicit.arrays import FloatArray
from explicit.relaxation.kernels.creep import CreepKind
from explicit.relaxation.uniaxial import checked_history, uniaxial_stress

_KNOTS = 401
"""Knots of the table of network B's stress: its error is below 1e-9 of the stress."""
_TOLERANCE = 1e-8
"""Relative error of the viscous stretch along a history."""


@dataclass(frozen=True)
class BergstromBoyce:
    """The creeping network."""

    ratio: float
    """Stiffness of network B over that of network A, s [-]."""
    resistance: float
    """Stress at which it flows at (lam_v - 1 + xi)^C per second, tau_hat [Pa]."""
    exponent: float = 4.0
    """Exponent of the stress m [-]."""
    chain_exponent: float = -1.0
    """Exponent of the chains' own creep C [-]."""
    first_creep: float = 0.01
    """Stretch that keeps the first creep finite, xi [-]."""

    def __post_init__(self) -> None:
        for name, good, allowed in (
            ("ratio", 0.0 <= self.ratio < np.inf, ">= 0 and finite"),
            ("resistance", 0.0 < self.resistance < np.inf, "> 0 Pa and finite"),
            ("exponent", 1.0 <= self.exponent <= 50.0, "in [1, 50]"),
            ("chain_exponent", -1.0 <= self.chain_exponent <= 0.0, "in [-1, 0]"),
            ("first_creep", 0.0 < self.first_creep <= 1.0, "in (0, 1]"),
        ):
            if not good:
                raise ValueError(f"{name} must be {allowed}, got {getattr(self, name)}")

    @property
    def instantaneous(self) -> float:
        """Stiffness of both networks over that of network A, 1 + s [-]."""
        return 1.0 + self.ratio

    def __len__(self) -> int:
        """One network."""
        return 1

    def row(self, n_branches: int) -> FloatArray:
        """Kernel row: s / (1 + s), tau_hat, m, C, xi, 1 / (1 + s)."""
        share = self.ratio / self.instantaneous
        flow = (self.resistance, self.exponent, self.chain_exponent, self.first_creep)
        return np.array([share, *flow, 1.0 - share])

    @staticmethod
    def kind(n_branches: int) -> CreepKind:
        """See `explicit.relaxation.base.RateDependence`."""
        return CreepKind()

    def flow_rate(self, stress: ArrayLike, chain_stretch: ArrayLike) -> FloatArray:
        """gamma of Eq. (V.3) [1/s].

        Parameters
        ----------
        stress : array
            Frobenius norm of the deviatoric stress of network B [Pa].
        chain_stretch : array
            lam_v [-].
        """
        crept = np.maximum(np.asarray(chain_stretch, dtype=float) - 1.0, 0.0) + self.first_creep
        return np.asarray(
            crept**self.chain_exponent * (np.asarray(stress, dtype=float) / self.resistance) ** self.exponent
        )


def bergstrom_boyce_stress(
    law: Any, network: BergstromBoyce, time: ArrayLike, stretch: ArrayLike
) -> tuple[FloatArray, FloatArray]:
    """Nominal stress and viscous stretch along a uniaxial history of an incompressible specimen.

    Between the samples log(lam) is linear in time; the specimen was at rest before the first one. The elastic
    stretch e = log(lam / lam_v) of network B is integrated implicitly, because the flow is stiff.

    Parameters
    ----------
    law
        Network A: an `explicit.materials.MaterialLaw`.
    network : BergstromBoyce
        Network B.
    time, stretch : array, shape [n]
        Times, not descending [s], and stretches [-]. A step of strain is two samples at one time.

    Returns
    -------
    tuple of array, shape [n]
        Nominal stress, tension-positive [Pa], and the viscous stretch lam_v along the load [-].

    Raises
    ------
    ValueError
        If the history is malformed, see `explicit.relaxation.prony_stress`, or the flow cannot be integrated.
    """
    t, lam = checked_history(time, stretch)
    total = np.log(lam)
    span = 1.01 * float(np.ptp(np.append(total, 0.0))) + 1e-6
    cauchy = _table(law, span)
    elastic, viscous = np.empty_like(t), 0.0  # log stretches
    elastic[0] = total[0]
    for first, last in _pieces(t):
        if first > 0:  # a step of strain is elastic
            elastic[first] = total[first] - viscous
        if last > first:
            piece = slice(first, last + 1)
            path = _creep(network, cauchy, t[piece], total[piece], total[first] - elastic[first])
            elastic[piece] = total[piece] - path
            viscous = float(path[-1])
    stress = uniaxial_stress(law, lam) + network.ratio * np.asarray(cauchy(elastic)) / lam
    return stress, np.exp(total - elastic)


def _table(law: Any, span: float) -> Callable[[Any], Any]:
    """Cauchy stress of the law over log stretch [Pa]."""
    knots = np.linspace(-span, span, _KNOTS)
    stretch = np.exp(knots)
    spline: Callable[[Any], Any] = CubicSpline(knots, uniaxial_stress(law, stretch) * stretch)
    return spline


def _pieces(time: FloatArray) -> list[tuple[int, int]]:
    """First and last sample of the stretches of time between steps of strain."""
    cuts = np.flatnonzero(np.diff(time) == 0.0)
    first = [0, *(cuts + 1).tolist()]
    last = [*cuts.tolist(), len(time) - 1]
    return list(zip(first, last, strict=True))


def _creep(
    network: BergstromBoyce,
    cauchy: Callable[[Any], Any],
    time: FloatArray,
    total: FloatArray,
    viscous: float,
) -> FloatArray:
    """log lam_v at the samples of a piece, shape [n]."""
    ratio, root = network.ratio, np.sqrt(2.0 / 3.0)
    if ratio == 0.0:
        return np.full_like(time, viscous)

    lowest, highest = min(float(total.min()), viscous), max(float(total.max()), viscous)

    def rate(t: float, state: FloatArray) -> list[float]:
        v = min(max(float(state[0]), lowest), highest)  # it lags behind, so only a trial can lie outside
        stress = ratio * float(cauchy(np.interp(t, time, total) - v))
        stretch = np.exp(v)
        chain = np.sqrt((stretch**2 + 2.0 / stretch) / 3.0)
        # |dev| = sqrt(2/3) |sigma| in uniaxial stress, and so is the share of D_v along the load
        return [root * float(network.flow_rate(root * abs(stress), chain)) * np.sign(stress)]

    found = solve_ivp(
        rate,
        (time[0], time[-1]),
        [viscous],
        method="LSODA",
        t_eval=time,
        rtol=_TOLERANCE,
        atol=1e-10,
        max_step=float(np.diff(time).max()),
    )
    if not found.success:
        raise ValueError(f"the flow of network B cannot be integrated along this history: {found.message}")
    return np.asarray(found.y[0])
