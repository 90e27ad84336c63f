"""Measured markers compared with the model: distances, misfit, and the fitted stiffness.

Markers lie on the base's middle line at equal shares of its length at rest. The last one is at the tip. The
distance of n markers is

    RMSE = sqrt(1/n sum |x_measured - x_simulated|^2),                                          (A.5)

The sum of |.|^2 / sigma^2 is compared with chi-square of 2 n degrees of freedom. Noise of sigma in each
coordinate explains the distances if the sum is below the 99.9 % quantile. One factor m of all moduli is
fitted to all markers, directions and pressures, with a fixed Poisson's ratio. The method is Gauss-Newton with
the exact du/dm. The interval is

    m +- t s_m,  s_m = sigma max(1, sqrt(chi2 / dof)) / |J|,                                    (A.6)

with J = dx/dm of all coordinates and Student's t of 95 %.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri, stdtrit

from kolsky.base.arrays import FloatArray
from kolsky.base.errors import InputError
from kolsky.bodies.actuator_bending import Direction
from kolsky.bodies.actuator_model import Actuator, Bending, bend_of
from kolsky.bodies.actuator_reading import ActuatorSpec
from kolsky.equilibrium.meshes import Mesh
from kolsky.equilibrium.sensitivity import direct
from kolsky.readers.table import Column, read_table

COUNT = 9
"""Markers on the paper's actuator."""
EXPLAINED = 0.999
"""Probability of the chi-square quantile above which noise does not explain a distance."""
ITERATIONS = 12
"""Maximum number of iterations of the fit."""
RANGE = 0.02, 50.0
"""Range of the factor in the fit [-]. The fit ends at the last factor inside."""
FIT_TOLERANCE = 1e-3
"""Step of m at which the fit ends, in its standard deviations."""
PLANE = (0, 2)
"""Coordinates of the plane of bending."""


@dataclass(frozen=True)
class MarkerComparison:
    """Markers of one direction of gravity and one pressure."""

    gravity: str
    pressure: float
    """Pressure [Pa]."""
    measured: FloatArray
    """Measured x and z [m], shape [n, 2]."""
    simulated: FloatArray
    """Simulated x and z [m], shape [n, 2]."""
    sigma: float
    """Standard deviation of a measured coordinate [m]."""

    @property
    def rmse(self) -> float:
        """Eq. (A.5) [m]."""
        return float(np.sqrt(((self.measured - self.simulated) ** 2).sum(axis=1).mean()))

    @property
    def explained(self) -> bool:
        """True if noise of `sigma` explains the distances."""
        square = float(((self.measured - self.simulated) ** 2).sum()) / self.sigma**2
        return square <= float(chdtri(self.measured.size, 1.0 - EXPLAINED))

    @property
    def measured_angle(self) -> float:
        """Bending angle from the origin to the last marker [rad]."""
        x, z = self.measured[-1]
        return float(bend_of(np.array([x, 0.0, z])))


@dataclass(frozen=True)
class StiffnessFit:
    """The factor of all moduli, fitted to the markers."""

    factor: float
    """Stiffness factor m [-]."""
    sigma: float
    """Its standard deviation, Eq. (A.6) [-]."""
    low: float
    """Lower end of the 95 % interval [-]."""
    high: float
    """Upper end of the 95 % interval [-]."""
    chi2: float
    """Sum of squares over sigma^2 at the fitted factor [-]."""
    degrees: int
    converged: bool

    @property
    def explained(self) -> bool:
        """True if noise explains the residual."""
        return self.chi2 <= float(chdtri(self.degrees, 1.0 - EXPLAINED))


def marker_weights(x: FloatArray, count: int = COUNT) -> FloatArray:
    """Weights of the points of a line, at increasing coordinates x [m], in each marker, [count, n_line]."""
    shares = x[0] + (x[-1] - x[0]) * np.arange(1, count + 1) / count
    return np.stack([np.interp(shares, x, unit) for unit in np.eye(len(x))], axis=-1)


def marker_positions(run: Bending, weights: FloatArray) -> FloatArray:
    """Positions of the markers in the plane of bending [m], shape [n_steps, count, 2]."""
    mesh = run.solution.model.mesh
    nodes = mesh.nodes("line")
    line = mesh.points[nodes] + run.solution.displacements[:, nodes]
    return np.asarray((weights @ line)[..., PLANE])


def compare(run: Bending, gravity: str, step: int, measured: FloatArray, sigma: float) -> MarkerComparison:
    """Compare measured markers [m] of shape [n, 2] with a step of a simulation."""
    weights = marker_weights(_line(run.solution.model.mesh), len(measured))
    simulated = marker_positions(run, weights)[step]
    return MarkerComparison(gravity, float(run.pressures[step].max()), measured, simulated, sigma)


def _line(mesh: Mesh) -> FloatArray:
    return mesh.points[mesh.nodes("line"), 0]


def interval(
    left: FloatArray, J: FloatArray, sigma: float, factor: float, *, converged: bool
) -> StiffnessFit:
    """Interval of a factor by Eq. (A.6). It is computed from the residual [m] and dx/dm [m], each of shape
    [n]."""
    degrees = left.size - 1
    square = float((left**2).sum()) / sigma**2
    deviation = sigma * max(1.0, np.sqrt(square / degrees)) / float(np.linalg.norm(J))
    half = float(stdtrit(degrees, 0.975)) * deviation
    return StiffnessFit(factor, deviation, factor - half, factor + half, square, degrees, converged)


def fit_stiffness(
    actuator: Actuator,
    gravities: Mapping[str, Sequence[float] | FloatArray],
    measured: Mapping[str, Mapping[float, FloatArray]],
    sigma: float,
) -> StiffnessFit:
    """Fit the factor m of all moduli to markers."""
    moduli = actuator.constants(2.0) - actuator.constants()  # 0 of constants that are pure numbers
    factor, converged = 1.0, False
    guesses: dict[str, FloatArray] = {}
    for _ in range(ITERATIONS):
        lefts, slopes = [], []
        for name, sets in measured.items():
            pressures = np.array(sorted(sets))
            constants, guess = actuator.constants(factor), guesses.get(name)
            run = actuator.simulate(gravities[name], pressures, constants=constants, guess=guess)
            run.solution.outcome.require(f"{name} at {factor:.3g} times the stiffness")
            guesses[name] = run.solution.displacements
            count = len(next(iter(sets.values())))
            weights = marker_weights(_line(actuator.mesh), count)
            nodes = actuator.mesh.nodes("line")
            by = direct(run.solution).displacements[:, : moduli.size, nodes]  # [steps, constants, line, 3]
            by_factor = np.einsum("c,scld->sld", moduli.ravel(), by)
            slope = (weights @ by_factor)[..., PLANE]
            wanted = np.stack([sets[p] for p in pressures])
            lefts.append((wanted - marker_positions(run, weights)).ravel())
            slopes.append(slope.ravel())
        left, J = np.concatenate(lefts), np.concatenate(slopes)
        fit = interval(left, J, sigma, factor, converged=converged)
        if converged:
            return fit
        step = float(J @ left) / float(J @ J)
        following = float(np.clip(factor + step, 0.5 * factor, 2.0 * factor))
        if not RANGE[0] < following < RANGE[1]:
            return fit
        factor = following
        converged = abs(step) <= FIT_TOLERANCE * fit.sigma
    return fit


EQUAL_PRESSURES = 1e-6
"""Largest difference of equal pressures, as a share of the largest pressure [-]."""


def compared_markers(
    spec: ActuatorSpec, directions: Sequence[Direction]
) -> tuple[list[MarkerComparison], StiffnessFit | None, dict[str, str]]:
    """Compare the markers of a SPEC with the simulation, and fit the stiffness. The hash of their file is
    returned too."""
    section = spec.declared.markers
    if section is None:
        return [], None, {}
    measured, sha256 = _read_markers(spec)
    by_name = {one.name: one for one in directions}
    comparisons = []
    for name, sets in measured.items():
        one = by_name[name]
        for pressure, places in sets.items():
            step = int(np.argmin(np.abs(one.pristine.pressures.max(axis=1) - pressure)))
            comparisons.append(compare(one.pristine, name, step, places, section.sigma))
    stiffness = fit_stiffness(spec.actuator, spec.gravities, measured, section.sigma)
    return comparisons, stiffness, {section.file: sha256}


def _read_markers(spec: ActuatorSpec) -> tuple[dict[str, dict[float, FloatArray]], str]:
    """Markers [m] of shape [n, 2] by direction of gravity and pressure [Pa], and the hash of their file."""
    section = spec.declared.markers
    assert section is not None  # called only if declared
    path = spec.toml.path.parent / section.file
    if "line" not in spec.actuator.mesh.sets:
        raise spec.toml.error(
            "markers", 'need the set "line" of the mesh', cure="name the base's middle line"
        )
    table = read_table(path, layout=None if section.layout is None else section.layout.as_layout())
    numbers = table.integers(Column(section.marker))
    pressures = table.values(section.pressure.as_column())
    named = Column(section.gravity)
    names = [table.field(table.index(named), row).strip() for row in range(len(numbers))]
    x, z = table.values(section.x.as_column()), table.values(section.z.as_column())
    declared = spec.pressures
    markers: dict[str, dict[float, FloatArray]] = {}
    for name in dict.fromkeys(names):
        if name not in spec.gravities:
            raise InputError(path, f"names the direction {name!r}", allowed=", ".join(spec.gravities))
        markers[name] = {}
        rows = np.array([other == name for other in names])
        for pressure in np.unique(pressures[rows]):
            if np.abs(declared - pressure).min() > EQUAL_PRESSURES * declared.max():
                raise InputError(
                    path,
                    f"has a pressure of {pressure:g} Pa, which SPEC does not declare",
                    allowed=", ".join(f"{p:g}" for p in declared),
                )
            own = np.flatnonzero(rows & (pressures == pressure))
            own = own[np.argsort(numbers[own], kind="stable")]
            if not np.array_equal(numbers[own], np.arange(1, len(own) + 1)):
                raise InputError(
                    path,
                    f"has the markers {numbers[own].astype(int).tolist()} of {name} at {pressure:g} Pa",
                    allowed="1, 2, ..., each once, from the clamped end on",
                )
            markers[name][float(pressure)] = np.column_stack([x[own], z[own]])
    return markers, table.sha256
