"""Records of a comparison of rates: one shot, a group of them, the report."""

from dataclasses import dataclass

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.base.records import MaterialCurve
from kolsky.inverse.parameters import PARAMETERS
from kolsky.inverse.result import Identification, Verdict
from kolsky.studies.rates.motion import StrainHistory
from kolsky.studies.rates.pooled import Pooled
from kolsky.studies.rates.regression import Slope

COUNTED = tuple(verdict for verdict in Verdict if verdict.identified)
"""Verdicts with which a stiffness factor counts in a mean."""
WITHHELD = (Verdict.UNEXPLAINED, Verdict.CONTRADICTED)
"""Verdicts with which it counts only if that is asked for: the model does not explain the data."""
PARAMETER = "stiffness_factor"
COMMON_PARTS = {"material curve": "curve", "force scale": "rig", "motion scale": "rig"}
"""Parts of the noise that shots share, and what they share it through."""
COMMON_DECLARED = {
    "sensitivity": "rig",
    "clock_offset": "rig",
    "curve_scale": "curve",
    "specimen_density": "group",
    **{name: "group" for name, p in PARAMETERS.items() if p.uncertainty},
}
"""Keys of [uncertainty] that shots share, likewise; a specimen's size and the place of the cameras' axes are
each shot's own."""


@dataclass(frozen=True)
class QuasiStatic:
    """The baseline that the stiffness factor multiplies."""

    curve: MaterialCurve
    """The curve, from rest outward."""
    source: str
    """SHA-256 of its numbers: shots with the same one share its errors."""
    rate: float | None
    """Nominal strain rate it was measured at [1/s]; None if the shot file does not say."""


@dataclass(frozen=True)
class RatedShot:
    """One identified shot with its rate."""

    name: str
    """Name of the shot."""
    group: str
    """What it is compared within."""
    rig: str
    """Whose transducers and cameras saw it; shots of one rig share their scales."""
    history: StrainHistory
    """Its strain and strain rate."""
    quasi_static: QuasiStatic
    """Its baseline."""
    found: Identification
    """The whole result."""
    specimen: tuple[float, float]
    """Diameter and length [m]."""
    conditions: dict[str, str]
    """What must not differ between shots that are compared: damping, mesh, interface, ... in words."""
    keep_unexplained: bool = False
    """Whether it counts although the model does not explain its data."""

    @property
    def m(self) -> float:
        """Stiffness factor [-]."""
        return self.found.estimates[PARAMETER].value

    @property
    def sigma(self) -> float:
        """Its standard uncertainty, shared parts included [-]."""
        return self.found.estimates[PARAMETER].sigma

    @property
    def sigma_own(self) -> float:
        """The part that is independent from shot to shot [-]."""
        estimate = self.found.estimates[PARAMETER]
        own = [s for name, s in estimate.noise_parts.items() if name not in COMMON_PARTS]
        own.append(estimate.numerical_parts.get("roughness", 0.0))
        own += [shift for key, shift in self._declared().items() if key not in COMMON_DECLARED]
        return float(np.sqrt(sum(s**2 for s in own)))

    @property
    def verdict(self) -> Verdict:
        """The outcome of its search."""
        return self.found.estimates[PARAMETER].outcome

    @property
    def counted(self) -> bool:
        """True if it enters the mean."""
        good = COUNTED + (WITHHELD if self.keep_unexplained else ())
        return self.verdict in good and np.isfinite(self.m) and self.sigma_own > 0.0

    def excess(self, channel: str) -> float:
        """Residual of a channel over what a right model leaves [-]; NaN if it was not recorded."""
        return next((fit.excess for fit in self.found.fit if fit.channel == channel), float("nan"))

    def common_parts(self) -> dict[tuple[str, str], float]:
        """Shared parts: (part, through what) -> by how much m moves with one standard uncertainty."""
        estimate = self.found.estimates[PARAMETER]
        through = {"curve": self.quasi_static.source, "rig": self.rig, "group": self.group}
        parts = {
            (name, through[way]): estimate.noise_parts[name]
            for name, way in COMMON_PARTS.items()
            if estimate.noise_parts.get(name, 0.0) > 0.0
        }
        mesh = estimate.numerical_parts.get("mesh", estimate.sigma_numerical)
        if mesh > 0.0:
            # What the correction leaves is mostly the element's, which errs to the same side in all of them,
            # whatever the side that the mesh had been corrected to.
            parts["mesh and step", self.conditions["mesh"]] = mesh
        declared = {
            (f"declared {key.replace('_', ' ')}", through[COMMON_DECLARED[key]]): shift
            for key, shift in self._declared().items()
            if key in COMMON_DECLARED
        }
        return parts | declared

    def _declared(self) -> dict[str, float]:
        """Shift of m by each declared uncertainty of an input."""
        moves = {part.key: part.shifts.get(PARAMETER, 0.0) for part in self.found.systematic}
        return {key: shift for key, shift in moves.items() if shift != 0.0}


@dataclass(frozen=True)
class StiffnessAtStrain:
    """Stress and moduli at one nominal compressive strain, of every counted shot and of the baseline."""

    strain: float
    """Nominal compressive strain [-]; 0 has the tangent modulus alone."""
    shots: tuple[str, ...]
    """The shots that reached it, length n."""
    rates: FloatArray
    """Their nominal rates [1/s], shape [n]."""
    quantities: dict[str, tuple[FloatArray, FloatArray]]
    """Name -> values and standard uncertainties of the shots [Pa], shape [n] each."""
    baseline: dict[str, tuple[float, float]]
    """Name -> the quasi-static curve's own value and standard uncertainty [Pa]."""


@dataclass(frozen=True)
class ShapeAtStrain:
    """The outline of one shot in the frame nearest to a strain."""

    shot: str
    strain: float
    """The strain asked for [-]."""
    at: float
    """The strain of the frame [-]."""
    y: FloatArray
    """Heights [m], shape [n]."""
    Z: FloatArray
    """Measured radius [m], shape [n]."""
    sigma: FloatArray
    """Its standard deviation [m], shape [n]."""
    model: FloatArray
    """Simulated radius [m], shape [n]; NaN outside the model's range."""


@dataclass(frozen=True)
class EqualStrain:
    """Shape and force of the shots at equal strain: the paper's Figs. 13 and 14."""

    strains: FloatArray
    """Strains that every shot here reached [-], shape [k]."""
    shots: tuple[str, ...]
    """Length n."""
    force: FloatArray
    """Measured force [N], shape [n, k]."""
    sigma: FloatArray
    """Its standard deviation [N], shape [n, k]."""
    force_model: FloatArray
    """Simulated force [N], shape [n, k]."""
    baseline_strain: FloatArray
    """Strains of the next line, up to the largest that every shot reached [-], shape [b]."""
    baseline_force: FloatArray
    """The first shot's quasi-static stress times its undeformed area [N], shape [b]; NaN past the curve."""
    shapes: tuple[ShapeAtStrain, ...]
    """Every outline, by strain and shot."""
    shape_scatter: FloatArray
    """Standard deviation between shots of the measured radius, rms over the height [m], shape [k]; NaN with
    fewer than two outlines."""
    residual_scatter: FloatArray
    """The same of measured minus simulated radius: what the simulation does not explain [m], shape [k]."""


@dataclass(frozen=True)
class LongLever:
    """From the quasi-static rate to the mean of the shots: two points, and many decades."""

    decades: float
    """Decades between the quasi-static rate and the geometric mean of the shots'."""
    slope: float
    """(mean m - 1) over the decades [1/decade]."""
    interval: tuple[float, float]
    """Its 95 % interval [1/decade]."""


@dataclass(frozen=True)
class GroupRates:
    """Shots of one group."""

    name: str
    """The group."""
    shots: tuple[RatedShot, ...]
    """All of them, slowest first."""
    common: dict[tuple[str, str], FloatArray]
    """(part, through what) -> by how much each counted shot moves with it [-], shape [n_counted]."""
    pooled: Pooled | None
    """Their mean; None with fewer than two counted shots."""
    slope: Slope | None
    """Stiffness against rate; None likewise."""
    long_lever: LongLever | None
    """None if the quasi-static rate is not declared, or not one, or there is no mean."""
    stiffness: tuple[StiffnessAtStrain, ...]
    """At each strain that was asked for and reached."""
    equal_strain: EqualStrain | None
    """None if no strain was reached by a shot."""
    remarks: tuple[str, ...]
    """What a reader must know, one sentence each."""

    @property
    def counted(self) -> tuple[RatedShot, ...]:
        """The shots that enter the mean."""
        return tuple(shot for shot in self.shots if shot.counted)


@dataclass(frozen=True)
class RateReport:
    """The comparison of all groups."""

    grouped_by: str
    """Key of the shot files that the groups are values of; "" if all shots are one group."""
    shared: float
    """Relative standard uncertainty that was declared common to all shots [-]."""
    groups: tuple[GroupRates, ...]
    """By name."""
