"""The trends of Mates et al. (2012), their Figs. 7 to 10, for any shot with an outline.

The figures show the effect of each parameter on the misfits before any identification. Poisson's ratio
affects the shape and the cost of a run. Damping affects the force. Friction and stiffness affect both. The
last figure shows the accuracy of surrogates.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from doe import Box, CostSurrogate, Design, ResponseSurrogate, full_factorial
from explicit import Response
from kolsky.base.arrays import FloatArray
from kolsky.inverse.observations import Observations, Prediction, predict
from kolsky.inverse.problem import PreparedShot, prepare_shot
from kolsky.inverse.run_table import Terms, terms
from kolsky.inverse.settings import Numerics
from kolsky.shot.records import Shot
from kolsky.studies.local_sensitivity import completed_runs

POISSON = (0.49, 0.492, 0.494, 0.495, 0.496, 0.497, 0.498, 0.499, 0.4995, 0.4999)
"""Poisson's ratios of Fig. 7."""
DAMPING = (0.0, 2.5e-5, 1e-4, 4e-4)
"""Dampings of Fig. 8 [s]."""
PLANE = {"friction": (0.0, 2.0), "stiffness_factor": (0.75, 1.25)}
"""The ranges of Fig. 9, with ten levels each as in the paper."""
LEVELS = 10
STIFFNESS = (0.75, 1.5)
"""The range of Fig. 10."""
RUNS = 16
"""Number of runs over this range."""
FINE = 301
"""Number of points at which surrogates are shown along a parameter."""
GRID = 101
"""Number of points along each parameter of a plane."""


@dataclass(frozen=True)
class Along:
    """Runs along one parameter."""

    x: FloatArray
    """Values of the parameter, in its unit, shape [n]."""
    phi_force: FloatArray
    """Phi_F of each run [N], shape [n]."""
    phi_shape: FloatArray
    """Phi_S of each run [-], shape [n]."""
    steps: NDArray[np.int64]
    """Number of time steps of each run, a measure of its cost, shape [n]."""


@dataclass(frozen=True)
class Forces:
    """Forces of runs with different damping."""

    damping: FloatArray
    """beta [s], shape [n]."""
    time: FloatArray
    """Recorded times [s], shape [P]."""
    simulated: FloatArray
    """Forces at them [N], shape [n, P]."""
    measured: FloatArray
    """Recorded force [N], shape [P]."""


@dataclass(frozen=True)
class Plane:
    """Misfits over the plane of two parameters."""

    design: Design
    """The runs."""
    phi_force: FloatArray
    """Phi_F of each [N], shape [n]."""
    phi_shape: FloatArray
    """Phi_S of each [-], shape [n]."""
    axes: tuple[FloatArray, FloatArray]
    """Values of both parameters on the grid, in their units, shape [GRID] each."""
    surface_force: FloatArray
    """Radial basis functions through Phi_F on the grid [N], shape [GRID, GRID], first parameter first."""
    surface_shape: FloatArray
    """Likewise of Phi_S [-]."""

    def left_beyond(self, friction: float) -> tuple[float, float]:
        """Range of Phi_F and Phi_S where friction is at least `friction`, over their full range [-]. Means
        over the stiffness are compared, because oscillations of the force make single runs scatter."""
        f = np.unique(self.design.points[:, 0])
        shares = []
        for phi in (self.phi_force, self.phi_shape):
            mean = phi.reshape(len(f), -1).mean(axis=1)
            shares.append(float(np.ptp(mean[f >= friction]) / np.ptp(mean)))
        return shares[0], shares[1]


@dataclass(frozen=True)
class Surrogates:
    """Misfits along the stiffness factor: runs and predictions of surrogates."""

    runs: Along
    """The runs that surrogates are built from."""
    between: Along
    """Runs halfway between those, which no surrogate uses."""
    x: FloatArray
    """Values of the curves [-], shape [FINE]."""
    by_cost: tuple[FloatArray, FloatArray]
    """Phi_F [N] and Phi_S [-] of radial basis functions through the runs' misfits, as in the paper."""
    by_response: tuple[FloatArray, FloatArray]
    """Phi_F [N] and Phi_S [-] of the histories that a surrogate of the response predicts."""

    def errors(self) -> dict[str, tuple[float, float]]:
        """Largest error of Phi_F and Phi_S of each surrogate at the runs in between, relative to Phi there
        [-]."""
        found = {}
        for name, curves in (("cost", self.by_cost), ("response", self.by_response)):
            pairs = zip(curves, (self.between.phi_force, self.between.phi_shape), strict=True)
            here = [np.interp(self.between.x, self.x, curve) / real - 1.0 for curve, real in pairs]
            found[name] = (float(np.abs(here[0]).max()), float(np.abs(here[1]).max()))
        return found


@dataclass(frozen=True)
class Trends:
    """All four figures."""

    shot: str
    stiffness: float
    """Stiffness factor of the runs over Poisson's ratio and damping [-]."""
    mesh: tuple[int, int]
    """Elements across the radius and along the length; the plane has `plane_mesh`."""
    plane_mesh: tuple[int, int]
    """The mesh of the runs over the plane."""
    poisson: Along
    """Fig. 7."""
    damping: Forces
    """Fig. 8."""
    plane: Plane
    """Fig. 9."""
    surrogates: Surrogates
    """Fig. 10."""


def trends(
    shot: Shot,
    *,
    stiffness: float = 1.0,
    numerics: Numerics | None = None,
    plane_mesh: tuple[int, int] = (16, 22),
) -> Trends:
    """Run the simulations of all four figures.

    ``shot``: a loaded shot with an outline. ``stiffness``: stiffness factor of the runs over Poisson's ratio
    and damping: 1 in the paper. ``numerics``: mesh, precision, device. ``plane_mesh``: coarser mesh for the
    runs over the plane. Raises ValueError if no outline was measured, or a run does not complete.
    """
    numerics = numerics or Numerics()
    prepared = prepare_shot(shot)
    if not prepared.observations.has_shape:
        raise ValueError(f"{shot.name}: the trends of Phi_S need a measured outline")
    return Trends(
        shot=shot.name,
        stiffness=stiffness,
        mesh=numerics.mesh,
        plane_mesh=plane_mesh,
        poisson=_along(prepared, "poisson", np.array(POISSON), numerics, stiffness_factor=stiffness)[0],
        damping=_forces(prepared, numerics, stiffness),
        plane=_plane(prepared, numerics.with_mesh(plane_mesh)),
        surrogates=_surrogates(prepared, numerics),
    )


def _run(
    prepared: PreparedShot, numerics: Numerics, **columns: FloatArray | float
) -> tuple[Response, Prediction]:
    response = completed_runs(prepared.forward, columns, numerics)
    return response, predict(response, prepared.observations)


def _terms(prediction: Prediction, observations: Observations) -> list[Terms]:
    return [terms(prediction, observations, i) for i in range(len(prediction.force))]


def _along(
    prepared: PreparedShot, name: str, x: FloatArray, numerics: Numerics, **held: float
) -> tuple[Along, Prediction]:
    columns: dict[str, FloatArray | float] = {**held, name: x}
    response, prediction = _run(prepared, numerics, **columns)
    found = _terms(prediction, prepared.observations)
    along = Along(
        x=x,
        phi_force=np.array([t.phi_force for t in found]),
        phi_shape=np.array([t.phi_shape for t in found]),
        steps=response.steps,
    )
    return along, prediction


def _forces(prepared: PreparedShot, numerics: Numerics, stiffness: float) -> Forces:
    damping = np.array(DAMPING)
    _, prediction = _run(prepared, numerics, damping=damping, stiffness_factor=stiffness)
    force = prepared.observations.force
    return Forces(damping, force.time, prediction.force, force.force)


def _plane(prepared: PreparedShot, numerics: Numerics) -> Plane:
    box = Box.of(PLANE)
    design = full_factorial(box, LEVELS)
    columns = {name: design.points[:, i] for i, name in enumerate(box.names)}
    _, prediction = _run(prepared, numerics, **columns)
    found = _terms(prediction, prepared.observations)
    phi_force, phi_shape = (
        np.array([getattr(t, name) for t in found]) for name in ("phi_force", "phi_shape")
    )
    axes = [np.linspace(a, b, GRID) for a, b in zip(box.lower, box.upper, strict=True)]
    grid = np.stack([axis.ravel() for axis in np.meshgrid(*axes, indexing="ij")], axis=1)
    surfaces = [
        CostSurrogate.fit(box, design.points, phi).predict(grid)[:, 0].reshape(GRID, GRID)
        for phi in (phi_force, phi_shape)
    ]
    return Plane(design, phi_force, phi_shape, (axes[0], axes[1]), surfaces[0], surfaces[1])


def _surrogates(prepared: PreparedShot, numerics: Numerics) -> Surrogates:
    box = Box.of({"stiffness_factor": STIFFNESS})
    levels = np.linspace(*STIFFNESS, RUNS)
    runs, prediction = _along(prepared, "stiffness_factor", levels, numerics)
    between, _ = _along(prepared, "stiffness_factor", 0.5 * (levels[1:] + levels[:-1]), numerics)
    x = np.linspace(*STIFFNESS, FINE)
    by_cost = [
        CostSurrogate.fit(box, levels[:, None], phi).predict(x[:, None])[:, 0]
        for phi in (runs.phi_force, runs.phi_shape)
    ]
    return Surrogates(
        runs, between, x, (by_cost[0], by_cost[1]), _by_response(prepared, box, levels, prediction, x)
    )


def _by_response(
    prepared: PreparedShot, box: Box, levels: FloatArray, prediction: Prediction, x: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Phi_F and Phi_S of predicted histories: force at every sample, outline where all runs have it."""
    observations = prepared.observations
    inside = prediction.inside.all(axis=0)
    vectors = np.concatenate([prediction.force, prediction.Z[:, inside]], axis=1)
    noise = np.concatenate([observations.force.sigma, observations.centre_line.sigma[inside]])
    model = ResponseSurrogate.fit(box, levels[:, None], vectors, scale=noise)
    told = model.predict(x[:, None])
    samples = len(observations.force.time)
    Z = np.full((len(x), inside.size), np.nan)
    Z[:, inside] = told[:, samples:]
    everywhere = np.broadcast_to(inside, Z.shape)
    # The terms compute the paper's misfits from forces and radii; they do not use the bins.
    bins = np.broadcast_to(observations.force_mean, (len(x), observations.n_force))
    found = _terms(Prediction(told[:, :samples], bins, Z, everywhere), observations)
    return np.array([t.phi_force for t in found]), np.array([t.phi_shape for t in found])
