"""Checks of one element by itself: exact gradient, damping, and the sharpness of its step bound."""

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from elements import Evaluated, evaluate
from numpy.typing import NDArray
from patch import distorted
from scene import DENSITY, LENGTH, RADIUS, shear_modulus, speed_after_rise

from explicit import Mesh, Model, Samples, Sampling, cylinder, run
from explicit.elements import element as element_named
from explicit.materials import MarlowLaw, MaterialLaw, neo_hookean
from explicit.precision import precision

FloatArray = NDArray[np.float64]

DIFFERENCES = np.geomspace(1e-2, 1e-9, 15)
"""Steps of the central differences over an element's size [-]."""
GRADIENT_TOLERANCE = 1e-8
"""Best relative difference of force and energy slope [-]: central differences in fp64 reach the 2/3 power of
round-off, 4e-11, and K/mu = 100 multiplies the cancellation."""
BETA = 2.5e-5
"""Damping of the bound's study [s]."""


@dataclass(frozen=True)
class Bound:
    """Step bound over what it bounds, elements of randomly deformed meshes."""

    least: float
    """Smallest quotient of bound and largest eigenvalue [-]; below 1 the bound fails."""
    median: float
    """Median quotient [-]."""
    most: float
    """Largest quotient [-]."""


def states(mesh: Mesh, strain: float, seed: int) -> FloatArray:
    """Corner displacements [m] of a squeeze to 1 - strain with random, nearly isochoric motions on top."""
    rng = np.random.default_rng(seed)
    r, y = mesh.nodes.T
    stretch = 1.0 - strain
    bulge = rng.uniform(0.0, 0.5) * (1.0 - (2.0 * y / LENGTH - 1.0) ** 2)
    u_r = r * (stretch**-0.5 * (1.0 + 0.3 * strain * bulge) - 1.0)
    u_y = (stretch - 1.0) * y + 0.3 * strain * rng.uniform(-1.0, 1.0) * r * np.sin(np.pi * y / LENGTH)
    return np.column_stack([u_r, u_y])[mesh.quads]


def gradient_errors(
    element: str,
    law: MaterialLaw,
    *,
    strain: float = 0.4,
    volumetric: str = "quadratic",
    differences: FloatArray = DIFFERENCES,
) -> FloatArray:
    """Largest difference of a corner force from the energy's central difference, over the largest force.

    Shape [n_differences]. All elements of a distorted mesh, moved at random by 3 % of their size on top of
    the squeeze, so that the four points differ; one-point energies include the hourglass control's.
    """
    mesh = distorted(cylinder(RADIUS, LENGTH, n_radial=5, n_axial=6))
    size = RADIUS / 5
    motion = states(mesh, strain, 3) + np.random.default_rng(4).normal(0.0, 0.03 * size, (30, 4, 2))
    given: dict[str, Any] = {"poisson": 0.495, "volumetric": volumetric}
    forces = evaluate(element, mesh, law, motion, **given).forces
    errors = []
    for difference in differences * size:
        slopes = np.zeros_like(forces)
        for a in range(4):
            for i in range(2):
                shift = np.zeros_like(motion)
                shift[:, a, i] = difference
                up, down = (evaluate(element, mesh, law, motion + s, **given) for s in (shift, -shift))
                energy = [found.elastic + found.hourglass for found in (up, down)]
                slopes[:, a, i] = (energy[0] - energy[1]) / (2.0 * difference)
        errors.append(np.abs(slopes - forces).max() / np.abs(forces).max())
    return np.array(errors)


def _slopes(mesh: Mesh, ask: "list[Evaluated]", difference: float) -> FloatArray:
    """Derivatives of the corner forces from pairs of evaluations, shape [n_elements, 8, 8]."""
    pairs = zip(ask[::2], ask[1::2], strict=True)
    columns = [(up.forces - down.forces).reshape(mesh.n_elements, 8) for up, down in pairs]
    return np.stack(columns, axis=-1) / (2.0 * difference)


def bound_quality(
    element: str,
    poisson: float,
    *,
    beta: float = 0.0,
    kind: str = "deviatoric",
    by: str = "trace",
    law: MaterialLaw | None = None,
    volumetric: str = "quadratic",
) -> Bound:
    """Compare the step bound with the element's own largest frequency in the states of a bonded impact."""
    mesh, states = impact_states(element, poisson)
    law = law or neo_hookean(shear_modulus(poisson))
    difference = 1e-6 * RADIUS
    given = {"poisson": poisson, "beta": beta, "damping_kind": kind, "hourglass": 0.3, "density": DENSITY}
    given["volumetric"] = volumetric
    inverse = inverse_mass(mesh, element)
    scale = np.sqrt(inverse[:, :, None] * inverse[:, None, :])
    quotients = []
    for motion in states:
        push, pull = [], []
        for k in range(8):
            shift = np.zeros_like(motion)
            shift[:, k // 2, k % 2] = difference
            for signed in (shift, -shift):
                push.append(evaluate(element, mesh, law, motion + signed, **given))  # type: ignore[arg-type]
                pull.append(evaluate(element, mesh, law, motion, velocity=signed, **given))  # type: ignore[arg-type]
        bound = evaluate(element, mesh, law, motion, bound=by, **given)  # type: ignore[arg-type]
        stiffness = _slopes(mesh, push, difference) * scale
        damping = _slopes(mesh, pull, difference) * scale
        quotients.append(bound.omega_squared / largest_frequency(stiffness, damping))
    every = np.concatenate(quotients)
    return Bound(float(every.min()), float(np.median(every)), float(every.max()))


@cache
def impact_states(element: str, poisson: float) -> tuple[Mesh, FloatArray]:
    """A 12 × 16 mesh, and its corners' displacements [m], shape [3, n_elements, 4, 2], at 20, 40 and 60 %."""
    mesh = cylinder(RADIUS, LENGTH, n_radial=12, n_axial=16)
    model = Model(
        mesh,
        DENSITY,
        (neo_hookean(shear_modulus(poisson)),),
        (speed_after_rise(2.6, 50e-6, end=1.5e-3),),
        element=element,
    )
    times = np.array([0.5e-3, 1.0e-3, 1.5e-3])
    response = run(model, Samples.of(poisson=poisson), Sampling(times, times, all_nodes=True))
    assert response.nodes is not None
    return mesh, (response.nodes[0] - mesh.nodes)[:, mesh.quads]


def inverse_mass(mesh: Mesh, element: str) -> FloatArray:
    """Inverse corner masses [1/kg], radial and axial in turn, 0 on the axis, shape [n_elements, 8]."""
    item = element_named(element)
    dtype = item.functions(MarlowLaw, precision("fp64")).Shape.numpy_dtype()
    shapes = item.shapes(mesh, DENSITY, dtype)
    pair = np.stack([shapes["inverse_mass_r"], shapes["inverse_mass_y"]], axis=-1)
    return np.asarray(pair.reshape(mesh.n_elements, 8))


def largest_frequency(stiffness: FloatArray, damping: FloatArray) -> FloatArray:
    """omega^2 of the undamped element with the same largest step, shape [n_elements], from matrices per mass,
    shape [n_elements, n, n].

    Central differences with damping at the old velocity are stable while K dt^2 / 4 + C dt / 2 < 1 (per unit
    mass); the limit s = 2 / dt is the largest eigenvalue of s^2 - s C - K.
    """
    count, n = stiffness.shape[:2]
    companion = np.zeros((count, 2 * n, 2 * n))
    companion[:, :n, n:] = np.eye(n)
    companion[:, n:, :n] = stiffness
    companion[:, n:, n:] = damping
    return np.asarray(np.linalg.eigvals(companion).real.max(axis=1) ** 2)
