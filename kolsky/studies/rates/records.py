"""Records of a comparison of rates: one shot with its strain history, a group of shots, the report."""

from dataclasses import dataclass

import numpy as np

from dic.views import ResultViews
from kolsky.bars.flyer.path import FlyerPath
from kolsky.base.arrays import FloatArray
from kolsky.base.records import FrontVelocity, MaterialCurve
from kolsky.inverse.result import Identification, Verdict
from kolsky.shot.inputs import INPUTS
from kolsky.shot.records import Shot
from kolsky.studies.rates.scatter import Pooled, Slope

ONSET = 0.01
"""Nominal strain at which the test begins [-]."""
CENTRAL = 0.9
"""Share of the strain covered by the reported range of the true rate."""
TIMES = 2001
"""Number of points of a strain history."""


@dataclass(frozen=True)
class StrainHistory:
    """Nominal strain against time while the front face moves toward the specimen, and its rate. The motion of
    the back face (a few um in a soft specimen) is not subtracted."""

    time: FloatArray
    """Times on the shot's clock, from the window's start to its largest strain [s], shape [n]."""
    strain: FloatArray
    """Nominal compressive strain [-], shape [n]: displacement divided by length."""
    span: tuple[float, float]
    """First time at a strain of 1 % and time of the largest strain [s]. They limit the averaged part."""
    nominal_rate: float
    """Mean velocity of the front face over that part, divided by the specimen's length, Eq. (S.1) [1/s]."""
    sigma_rate: float
    """Its standard uncertainty from the noise of the motion and its scale [1/s]."""
    true_rate: tuple[float, float]
    """Limits of the true rate, velocity over current length [1/s]. Between them are the central 90 % of the
    strain."""
    spread: float
    """Standard deviation of log10 of the true rate over the strain of the test [decade]."""

    @property
    def largest(self) -> float:
        """Largest nominal strain reached [-]."""
        return float(self.strain[-1])

    @property
    def sigma_decades(self) -> float:
        """Standard uncertainty of log10 of the rate of the test as a whole [decade]."""
        return float(np.hypot(self.spread, self.sigma_rate / (self.nominal_rate * np.log(10.0))))

    def time_at(self, strain: FloatArray) -> FloatArray:
        """First time at which a strain is reached [s], shape of `strain`.

        Raises ValueError if a strain is not positive or was not reached.
        """
        e = np.asarray(strain, dtype=float)
        bad = e[~((e > 0.0) & (e <= self.largest))]
        if bad.size:
            raise ValueError(f"a strain of {bad[0]:.4g} was not reached, the largest is {self.largest:.4g}")
        reached = np.maximum.accumulate(self.strain)
        return np.interp(e, reached, self.time)


def strain_history(shot: Shot) -> StrainHistory:
    """Strain history of a shot inside its window.

    Raises ValueError if the motion cannot be used, or if the compression in the window does not exceed 1 %.
    """
    path, flyer = shot.flyer_path, shot.flyer
    sigma_gain = flyer.sigma_gain if isinstance(flyer, FrontVelocity) else 0.0
    first, last = max(shot.window[0], path.start), min(shot.window[1], path.end)
    time = np.linspace(first, last, TIMES)
    return strain_history_of(path, time, shot.specimen.length, sigma_gain=sigma_gain)


def strain_history_of(
    path: FlyerPath, time: FloatArray, length: float, *, sigma_gain: float = 0.0
) -> StrainHistory:
    """Strain history of a path at given times."""
    strain = (path.position(time) - path.position(time[:1])) / length
    top = int(np.argmax(strain))
    if not ONSET < strain[top] < 1.0:
        raise ValueError(
            f"the largest nominal strain in the window is {strain[top]:.4g}, expected {ONSET:g} to 1: check"
            " the window and the unit of the front face's displacement"
        )
    onset = int(np.argmax(strain >= ONSET))
    span = float(time[onset]), float(time[top])
    seconds = span[1] - span[0]
    if seconds <= 0.0:
        raise ValueError("the specimen is compressed within one step of time: the window is too short")
    rate = float(strain[top] - strain[onset]) / seconds  # Eq. (S.1)
    noise = path.sigma_change(*span) / (length * seconds)
    part = slice(onset, top + 1)
    true = path.velocity(time[part]) / (length * (1.0 - strain[part]))
    forward = true[:-1] + true[1:] > 0.0
    middle, weight = 0.5 * (true[:-1] + true[1:])[forward], np.diff(strain[part])[forward]
    low, high, spread = _over_strain(middle, np.maximum(weight, 0.0))
    return StrainHistory(
        time=time[: top + 1], strain=strain[: top + 1], span=span, nominal_rate=rate,
        sigma_rate=float(np.hypot(noise, sigma_gain * rate)), true_rate=(low, high), spread=spread,
    )  # fmt: skip


def _over_strain(rate: FloatArray, weight: FloatArray) -> tuple[float, float, float]:
    """Range of the central share, and standard deviation of log10, weighted by the strain covered."""
    order = np.argsort(rate)
    passed = np.cumsum(weight[order])
    passed = (passed - 0.5 * weight[order]) / passed[-1]
    low, high = np.interp([0.5 - 0.5 * CENTRAL, 0.5 + 0.5 * CENTRAL], passed, rate[order])
    log = np.log10(rate)
    mean = np.average(log, weights=weight)
    return float(low), float(high), float(np.sqrt(np.average((log - mean) ** 2, weights=weight)))


COUNTED = tuple(verdict for verdict in Verdict if verdict.identified)
"""Verdicts of stiffness factors that are included in a mean."""
WITHHELD = (Verdict.UNEXPLAINED, Verdict.CONTRADICTED)
"""Verdicts that are included only on request: the model does not explain the data."""
PARAMETER = "stiffness_factor"
COMMON_PARTS = {"material curve": "curve", "force scale": "rig", "motion scale": "rig"}
"""Shared parts of the noise, and their common source."""
MESH_PART = "mesh and step"
"""The mesh error. In a mean it is common to shots on one mesh. In a slope it may depend on the rate."""


def _shared(key: str) -> str:
    """Common source of an input's error in several shots. Empty for a key that is not an input."""
    return INPUTS[key].shared if key in INPUTS else ""


@dataclass(frozen=True)
class QuasiStatic:
    """The baseline that the stiffness factor multiplies."""

    curve: MaterialCurve
    source: str
    """SHA-256 of its numbers. Shots with the same hash have the same errors of the curve."""
    rate: float | None
    """Nominal strain rate of its measurement [1/s]; None if not declared."""


@dataclass(frozen=True)
class RatedShot:
    """One identified shot with its rate."""

    name: str
    group: str
    rig: str
    """Test rig. Shots of one rig have the same scales of transducers and cameras."""
    history: StrainHistory
    quasi_static: QuasiStatic
    found: Identification
    specimen: tuple[float, float]
    """Diameter and length [m]."""
    conditions: dict[str, str]
    """Conditions that must be equal in compared shots: damping, mesh, interface, ... in words."""
    keep_unexplained: bool = False
    """True if it is included although the model does not explain its data."""

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
        own += [shift for key, shift in self._declared().items() if not _shared(key)]
        return float(np.sqrt(sum(s**2 for s in own)))

    @property
    def verdict(self) -> Verdict:
        """The outcome of its search."""
        return self.found.estimates[PARAMETER].outcome

    @property
    def counted(self) -> bool:
        """True if the mean includes it."""
        good = COUNTED + (WITHHELD if self.keep_unexplained else ())
        return self.verdict in good and np.isfinite(self.m) and self.sigma_own > 0.0

    def excess(self, channel: str) -> float:
        """Residual of a channel divided by that of a correct model [-]; NaN if not recorded."""
        return next((fit.excess for fit in self.found.fit if fit.channel == channel), float("nan"))

    def common_parts(self) -> dict[tuple[str, str], float]:
        """Shared parts: (part, common source) -> shift of m by one standard uncertainty."""
        estimate = self.found.estimates[PARAMETER]
        through = {"curve": self.quasi_static.source, "rig": self.rig, "group": self.group}
        parts = {
            (name, through[way]): estimate.noise_parts[name]
            for name, way in COMMON_PARTS.items()
            if estimate.noise_parts.get(name, 0.0) > 0.0
        }
        mesh = estimate.numerical_parts.get("mesh", estimate.sigma_numerical)
        if mesh > 0.0:
            # The error that remains after the correction is mostly that of the element. It has the same sign
            # in all shots, even if the meshes were corrected in different directions.
            parts[MESH_PART, self.conditions["mesh"]] = mesh
        declared = {
            (f"declared {key.replace('_', ' ')}", through[_shared(key)]): shift
            for key, shift in self._declared().items()
            if _shared(key)
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
    """Nominal compressive strain [-]. At 0, only the tangent modulus is given."""
    shots: tuple[str, ...]
    """The shots that reached it, length n."""
    rates: FloatArray
    """Their nominal rates [1/s], shape [n]."""
    quantities: dict[str, tuple[FloatArray, FloatArray]]
    """Name -> values and standard uncertainties of the shots [Pa], shape [n] each."""
    baseline: dict[str, tuple[float, float]]
    """Name -> value and standard uncertainty of the quasi-static curve [Pa]."""


@dataclass(frozen=True)
class ShapeAtStrain:
    """The outline of one shot in the frame nearest to a strain."""

    shot: str
    strain: float
    """The requested strain [-]."""
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
    """Strains that every shot of the comparison reached [-], shape [k]."""
    shots: tuple[str, ...]
    force: FloatArray
    """Measured force [N], shape [n, k]."""
    sigma: FloatArray
    """Its standard deviation [N], shape [n, k]."""
    force_model: FloatArray
    """Simulated force [N], shape [n, k]."""
    baseline_strain: FloatArray
    """Strains for the force below, up to the largest that every shot reached [-], shape [b]."""
    baseline_force: FloatArray
    """The first shot's quasi-static stress times its undeformed area [N], shape [b]; NaN beyond the curve."""
    shapes: tuple[ShapeAtStrain, ...]
    """Every outline, by strain and shot."""


@dataclass(frozen=True)
class LongLever:
    """Comparison of the quasi-static rate with the mean of the shots: two points over many decades."""

    decades: float
    """Decades between the quasi-static rate and the geometric mean of the shots' rates."""
    slope: float
    """(mean m - 1) divided by the decades [1/decade]."""
    interval: tuple[float, float]
    """Its 95 % interval [1/decade]."""


@dataclass(frozen=True)
class GroupRates(ResultViews):
    """Shots of one group."""

    name: str
    shots: tuple[RatedShot, ...]
    """All shots, slowest first."""
    common: dict[tuple[str, str], FloatArray]
    """(part, common source) -> shift of m of each counted shot [-], shape [n_counted]."""
    pooled: Pooled | None
    """Their mean; None with fewer than two counted shots."""
    slope: Slope | None
    """Stiffness against rate; None likewise."""
    long_lever: LongLever | None
    """Line from the quasi-static rate. None if this rate is not declared or not unique, or if there is no
    mean."""
    stiffness: tuple[StiffnessAtStrain, ...]
    """Stiffness at each requested strain that was reached."""
    equal_strain: EqualStrain | None
    """Comparison at equal strain. None if no requested strain was reached by all shots."""
    remarks: tuple[str, ...]

    @property
    def counted(self) -> tuple[RatedShot, ...]:
        """The shots that the mean includes."""
        return tuple(shot for shot in self.shots if shot.counted)

    @property
    def in_common(self) -> tuple[str, ...]:
        """Errors common to several counted shots, one phrase each. Each has its largest relative effect on
        m."""
        m = np.array([shot.m for shot in self.counted])
        found = []
        for (part, _), row in self.common.items():
            shots = int(np.count_nonzero(row))
            if shots > 1:
                size = 100.0 * float(np.max(np.abs(row) / m))
                found.append(f"{part} {size:.2g} % ({'all' if shots == len(m) else shots} shots)")
        return tuple(found)

    @property
    def own_range(self) -> tuple[float, float]:
        """Smallest and largest independent relative standard uncertainty of a counted shot [-]."""
        shares = [shot.sigma_own / shot.m for shot in self.counted]
        return min(shares), max(shares)


@dataclass(frozen=True)
class RateReport(ResultViews):
    """The comparison of all groups."""

    grouped_by: str
    """Key of the shot files for grouping; "" if all shots are one group."""
    shared: float
    """Relative standard uncertainty that was declared common to all shots [-]."""
    groups: tuple[GroupRates, ...]
    """Comparisons of the groups, sorted by name."""
