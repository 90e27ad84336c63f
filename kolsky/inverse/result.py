"""The answer: identified parameters with their intervals, and everything needed to defend them."""

from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from explicit import Response
from kolsky.base.arrays import FloatArray
from kolsky.base.records import CentreLine, ForceHistory
from kolsky.inverse.cause_results import CauseFinding
from kolsky.inverse.fit_results import ClockLag, FitQuality
from kolsky.inverse.method_comparison import Method
from kolsky.inverse.misfit import Terms
from kolsky.inverse.run_table import DesignTable
from kolsky.inverse.uncertainty_results import (
    Declaration,
    HeldAnswer,
    PairMap,
    ParameterProfile,
    PosteriorSummary,
    Variation,
)


class Verdict(StrEnum):
    """The outcome of the search for one parameter."""

    IDENTIFIED = "identified"
    FORCE_ALONE = "identified by the force alone"
    OUTLINE_ALONE = "identified by the outline alone"
    UNEXPLAINED = "not explained by the model"
    CONTRADICTED = "force and outline contradict each other"
    AT_BOUND = "at a bound of the design"
    BOUND_REACHED = "not told from a bound of the design"
    OTHER_VALLEY = "not told from another valley of the misfit"
    CONDITIONAL = "only if the parameter at its bound is right"
    NOT_SEEN = "not seen by the data"
    PLATEAU = "on a plateau of a rough misfit"
    DISAGREEING = "the check run disagrees with the surrogate"
    FAILED = "no simulation of the design completed"

    @property
    def confirmed(self) -> bool:
        """True if a run on the refined mesh left the optimum where it was."""
        return self not in (Verdict.DISAGREEING, Verdict.FAILED)

    @property
    def identified(self) -> bool:
        """True if the value is an answer: found inside the design, confirmed, explained by the model."""
        return self in (Verdict.IDENTIFIED, Verdict.FORCE_ALONE, Verdict.OUTLINE_ALONE)


@dataclass(frozen=True)
class Estimate:
    """One free parameter."""

    name: str
    """Parameter name, e.g. "stiffness_factor"."""
    unit: str
    """Unit, "1" if none."""
    value: float
    """Optimum of the joint chi-square, corrected for the error of the refined mesh: `on_mesh` plus
    `mesh_correction`."""
    sigma_noise: float
    """Standard uncertainty from the measured noise (force, shape, flyer motion, material curve)."""
    sigma_numerical: float
    """Standard uncertainty from the numerics, root sum of squares of `numerical_parts`."""
    mesh_shift: float
    """Value on the refined mesh minus value on the surrogate's mesh."""
    noise_parts: dict[str, float]
    """The share of `sigma_noise` by source: "force and shape", "force scale", "motion scale", "flyer
    motion" (the noise of whatever moves the front face), "material curve"."""
    outcome: Verdict
    """How the search ended."""
    sigma_systematic: float = 0.0
    """Standard uncertainty from what shot.toml declares in [uncertainty], 0 if it declares nothing."""
    numerical_parts: dict[str, float] = field(default_factory=dict)
    """The share of `sigma_numerical` by source: "mesh" (what the correction leaves of the error of mesh, step
    and element) and, where surfaces slide or several parameters are free, "roughness" of the response."""
    mesh_correction: float = 0.0
    """Extrapolation from the refined mesh to an infinitely fine one, which `value` contains; its standard
    uncertainty is the part "mesh" of `numerical_parts`. 0 in results that were not corrected."""
    searched: tuple[float, float] = (-np.inf, np.inf)
    """Range in which it was searched; infinite in results that do not know it."""

    @property
    def on_mesh(self) -> float:
        """Optimum on the refined mesh, where the check run, the profiles and the methods compared are."""
        return self.value - self.mesh_correction

    @property
    def sigma(self) -> float:
        """Combined standard uncertainty, root sum of squares."""
        return float(np.sqrt(self.sigma_noise**2 + self.sigma_numerical**2 + self.sigma_systematic**2))

    @property
    def interval(self) -> tuple[float, float]:
        """The k = 2 interval, see `within`."""
        return self.within(2.0 * self.sigma)

    def within(self, half: float) -> tuple[float, float]:
        """An interval of a half width about the value, as far as it lies in the range that was searched."""
        low, high = self.searched
        return max(self.value - half, low), min(self.value + half, high)


@dataclass(frozen=True)
class Contribution:
    """The part of one source in standard uncertainties."""

    source: str
    """ "force and shape", "flyer motion", "material curve", "force scale", "motion scale", "mesh",
    "roughness", "declared inputs"."""
    sigma: dict[str, float]
    """Standard uncertainty of each parameter from it, in parameter units."""


@dataclass(frozen=True)
class Route:
    """The optimum that one part of the data alone would choose."""

    name: str
    """ "joint", "force only", "shape only", "paper" (the cost Phi of Eq. (M.5))."""
    parameters: dict[str, float]
    """Optimum in parameter units, corrected for the error of the refined mesh where `correction` says so."""
    cost: float
    """Cost at the optimum."""
    sigma: dict[str, float]
    """Combined standard uncertainty by the route's own budget; empty for the paper's cost."""
    correction: dict[str, float] = field(default_factory=dict)
    """What the extrapolation to an infinitely fine mesh has added to `parameters`; empty if nothing."""
    budget: tuple[Contribution, ...] = ()
    """`sigma` by source; empty for the paper's cost."""

    def on_mesh(self, name: str) -> float:
        """Optimum of a parameter on the refined mesh."""
        return self.parameters[name] - self.correction.get(name, 0.0)


@dataclass(frozen=True)
class RouteDifference:
    """What the force alone says of the parameters, minus what the outline alone says."""

    values: dict[str, float]
    """Difference in parameter units, of the optima corrected for the error of the refined mesh."""
    sigma: dict[str, float]
    """Its combined standard uncertainty: a source that moves both alike has no part in it."""
    budget: tuple[Contribution, ...]
    """`sigma` by source."""


@dataclass(frozen=True)
class Comparison:
    """The check run beside the data, ready to draw."""

    force_time: FloatArray
    """Bin centres [s], shape [n_bins]."""
    force_measured: FloatArray
    """Bin means of the measured transmitted force [N], shape [n_bins]."""
    force_sigma: FloatArray
    """Their standard deviation [N], shape [n_bins]."""
    force_model: FloatArray
    """Bin means of the simulated force [N], shape [n_bins]."""
    centre_line: CentreLine
    """The measured points inside the window; none without an outline."""
    Z_model: FloatArray
    """Simulated Z at the measured points [m], shape [n_points]; NaN where `inside` is False."""
    inside: NDArray[np.bool_]
    """Points inside the model's range, shape [n_points]."""
    recorded: ForceHistory
    """The transmitted force at every recorded sample."""


@dataclass(frozen=True)
class SurrogateCurve:
    """The surrogate along one parameter, the others at their optimum."""

    parameter: str
    """The parameter that varies."""
    x: FloatArray
    """Its values, shape [n]."""
    chi2: FloatArray
    """Joint chi-square (with the discrepancy weights of the final search) [-], shape [n]."""
    phi_shape: FloatArray
    """Phi_S [-], shape [n]; NaN without an outline."""
    phi_force: FloatArray
    """Phi_F [N], shape [n]."""


@dataclass(frozen=True, repr=False)
class Identification:
    """The result of an identification."""

    shot: str
    """Name of the shot."""
    estimates: dict[str, Estimate]
    """One entry per free parameter."""
    fixed: dict[str, float]
    """The parameters held fixed, in SI."""
    routes: tuple[Route, ...]
    """Joint, force-only, outline-only and the paper's optimum; only the force's without an outline."""
    terms: Terms
    """Misfit terms of the check run at the optimum."""
    comparison: Comparison
    """The check run beside the data."""
    response: Response
    """The check run itself: a batch of one on the refined mesh, with all nodes."""
    mesh: tuple[int, int]
    """Elements across the radius and along the length, the surrogate's mesh."""
    refined_mesh: tuple[int, int]
    """The refined mesh: the check runs and the answer are on it."""
    design: DesignTable
    """Every run."""
    curves: tuple[SurrogateCurve, ...]
    """The surrogate along each free parameter."""
    surrogate: dict[str, float]
    """Surrogate quality: "loo_force" [N], "loo_shape" [m] (root-mean-square leave-one-out),
    "check_force" [N], "check_shape" [m] (surrogate against the check run, rms)."""
    seconds: dict[str, float]
    """Wall time by stage [s]."""
    warnings: tuple[str, ...] = ()
    """What a user must know before using the answer, one sentence each; see `kolsky.uncertainty.warnings`."""
    methods: tuple[Method, ...] = ()
    """What other methods find from the same data; the answer's own is the first."""
    systematic: tuple[Declaration, ...] = ()
    """What declared uncertainties of the inputs do to the answer, and what was not declared."""
    profiles: tuple[ParameterProfile, ...] = ()
    """The profile likelihood of each free parameter."""
    ridge: PairMap | None = None
    """The likelihood over the plane of two free parameters; None for another number of them."""
    posterior: PosteriorSummary | None = None
    """The posterior, if it was asked for."""
    variations: tuple[Variation, ...] = ()
    """What other choices of the analyst do to the answer."""
    fit: tuple[FitQuality, ...] = ()
    """Goodness of fit of force and outline; empty if it was not recorded (files before version 3)."""
    clocks: tuple[ClockLag, ...] = ()
    """Lags of the recordings' clocks that the model's residual shows; empty if they were not recorded."""
    held_answer: HeldAnswer | None = None
    """What the stiffness factor would be with the other free parameters held; None if it was free alone."""
    causes: tuple[CauseFinding, ...] = ()
    """Inputs that, changed, explain the misfit better, the likely causes first; empty if none was tried."""
    image_correlation: dict[str, float] = field(default_factory=dict)
    """Numbers of the surfaces that the shot's pictures gave, see `kolsky.shot.dic_summary.numbers`."""
    route_difference: RouteDifference | None = None
    """Force alone minus outline alone; None without an outline, or if it was not recorded."""
    provenance: dict[str, Any] = field(default_factory=dict)
    """Input hashes, settings, versions, seed, machine class, precision."""

    def __repr__(self) -> str:
        said = "; ".join(
            f"{name} = {e.value:.6g} ± {2.0 * e.sigma:.2g} (k = 2), {e.outcome}"
            for name, e in self.estimates.items()
        )
        return f"Identification({self.shot!r}: {said})"


def worst_imbalance(response: Response) -> float:
    """Largest |energy residual| of the batch's first simulation over its largest external work [-].

    NaN if it has no ledger, as when no simulation of a design completed.
    """
    if not np.isfinite(response.energy.external[0]).any():
        return float("nan")
    return float(response.energy.imbalance()[0])
