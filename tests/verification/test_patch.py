"""Patch test: homogeneous states on a distorted mesh, from the element constants and through the kernel."""

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from elements import evaluate
from scene import LENGTH, RADIUS, FloatArray, shear_modulus

from explicit import Mesh, cylinder
from explicit.materials import neo_hookean
from explicit.mesh import element_geometry

STRETCH = {"compressed": (1.25, 0.6), "pulled": (0.9, 1.3), "dilated": (1.05, 1.05), "small": (1.0005, 0.999)}
"""Homogeneous states: r -> a r, y -> b y with these (a, b) [-]."""
POISSON = 0.495
AMPLIFICATION = 100 * 100
"""Allowed error in units of round-off: K multiplies the rounding of J - 1 and is 100 mu here, and a force of
the smallest state (strain 5e-4, J - 1 the difference of strains) or a nodal sum loses two digits more."""
TOLERANCE = {"fp64": AMPLIFICATION * 2.2e-16, "fp32": AMPLIFICATION * 1.2e-7}
"""Largest force on an interior node over the largest corner force [-]."""
DISTORTION = 0.3  # interior nodes move by up to this share of an element's size [-]


Result = SimpleNamespace


def distorted(mesh: Mesh, share: float = DISTORTION, seed: int = 2) -> Mesh:
    """Move every interior node by up to `share` of its element's size; the outline stays."""
    nodes = mesh.nodes.copy()
    r, y = nodes.T
    size = np.array([np.unique(r.round(9))[1], np.unique(y.round(9))[1]])
    inside = (r > 0) & (r < r.max()) & (y > 0) & (y < y.max())
    shift = np.random.default_rng(seed).uniform(-share, share, (len(nodes), 2)) * size
    nodes[inside] += shift[inside]
    return replace(mesh, nodes=nodes)


def corner_forces(
    mesh: Mesh, name: str, motion: FloatArray, velocity: FloatArray, beta: float, element: str = "one_point"
) -> tuple[FloatArray, FloatArray]:
    """Corner forces [N], shape [n_elements, 4, 2], and dissipated powers [W] of the solver's own element."""
    law = neo_hookean(shear_modulus(POISSON))
    found = evaluate(
        element, mesh, law, motion[mesh.quads], poisson=POISSON, velocity=velocity[mesh.quads], beta=beta,
        precision_name=name,
    )  # fmt: skip
    return found.forces, found.power


def assemble(mesh: Mesh, corners: FloatArray) -> FloatArray:
    """Nodal sums of corner forces, shape [n_nodes, 2]."""
    total = np.zeros((mesh.n_nodes, 2))
    np.add.at(total, mesh.quads, corners)
    return total


def nominal_stress(a: float, b: float) -> tuple[float, float]:
    """Closed-form first Piola stress (P_rr, P_yy) of the neo-Hookean state r -> a r, y -> b y [Pa]."""
    mu = shear_modulus(POISSON)
    bulk = 2.0 * mu * (1.0 + POISSON) / (3.0 * (1.0 - 2.0 * POISSON))
    jacobian = a * a * b
    mean = (2.0 * a * a + b * b) / 3.0
    pressure = bulk * (jacobian - 1.0)
    cauchy = [mu * jacobian ** (-5.0 / 3.0) * (stretch**2 - mean) + pressure for stretch in (a, b)]
    return cauchy[0] * a * b, cauchy[1] * a * a


def homogeneous(
    mesh: Mesh, name: str, element: str = "one_point"
) -> tuple[dict[str, float], dict[str, float], float]:
    """Impose every state of `STRETCH` and a rigid shift in one precision.

    Returns the largest interior force over the largest corner force and the relative error of the face force,
    by state, and the largest force of the shift over mu R^2 [-].
    """
    r, y = mesh.nodes.T
    inside = (r > 0) & (r < r.max()) & (y > 0) & (y < y.max())
    rest = np.zeros((mesh.n_nodes, 2))
    interior, face = {}, {}
    for state, (a, b) in STRETCH.items():
        motion = np.column_stack([(a - 1.0) * r, (b - 1.0) * y])
        corners, _ = corner_forces(mesh, name, motion, rest, 0.0, element)
        nodal = assemble(mesh, corners)
        interior[state] = float(np.abs(nodal[inside]).max() / np.abs(corners).max())
        exact = -nominal_stress(a, b)[1] * np.pi * RADIUS**2
        face[state] = float(abs(nodal[mesh.lower_face, 1].sum() / exact - 1.0))
    shift = rest + np.array([0.0, 0.1 * LENGTH])
    corners, _ = corner_forces(mesh, name, shift, 1e4 * shift, 1e-4, element)
    return interior, face, float(np.abs(corners).max() / (shear_modulus(POISSON) * RADIUS**2))


def rate_power(mesh: Mesh, element: str = "one_point") -> float:
    """Power of uniform isochoric stretching at rest over 2 beta mu D : D V, minus 1 [-].

    D = rate (-1/2, 1, -1/2).
    """
    rate, beta = 100.0, 1e-4
    r, y = mesh.nodes.T
    stretching = np.column_stack([-0.5 * rate * r, rate * y])
    _, power = corner_forces(mesh, "fp64", np.zeros_like(stretching), stretching, beta, element)
    exact = 2.0 * beta * shear_modulus(POISSON) * 1.5 * rate**2 * np.pi * RADIUS**2 * LENGTH
    return float(power.sum() / exact - 1.0)


@cache
def case() -> Result:
    """Evaluate all states on one distorted mesh."""
    mesh = distorted(cylinder(RADIUS, LENGTH, n_radial=7, n_axial=9, grading=1.0))
    geometry = element_geometry(mesh)
    r, y = mesh.nodes.T
    inside = (r > 0) & (r < r.max()) & (y > 0) & (y < y.max())

    # Every linear field (u_y may shear; u_r = c R is the only linear radial field of an axisymmetric body).
    gradient_error = 0.0
    for a, b, shear in ((1.25, 0.6, 0.0), (0.9, 1.3, 0.2)):
        u_r, u_y = (a - 1.0) * r, shear * r + (b - 1.0) * y
        found = [
            np.einsum("ea,ea->e", matrix, field[mesh.quads])
            for matrix, field in (
                (geometry.gradient_r, u_r), (geometry.gradient_y, u_r), (geometry.hoop, u_r),
                (geometry.gradient_r, u_y), (geometry.gradient_y, u_y),
            )
        ]  # fmt: skip
        for value, imposed in zip(found, (a - 1.0, 0.0, a - 1.0, shear, b - 1.0), strict=True):
            gradient_error = max(gradient_error, float(np.abs(value - imposed).max()))

    weak_error = 0.0
    for p_rr, p_yy in ((1.0, 0.0), (0.0, 1.0), (1.0, -2.0)):
        radial = p_rr * (geometry.gradient_r + geometry.hoop)  # hoop stress = radial stress
        corners = np.stack([radial, p_yy * geometry.gradient_y], axis=-1) * geometry.volume[:, None, None]
        weak_error = max(
            weak_error, float(np.abs(assemble(mesh, corners)[inside]).max() / np.abs(corners).max())
        )

    fields = np.column_stack([np.ones_like(r), r / r.max(), y / y.max()])
    hourglass = np.einsum("ea,eaf->ef", geometry.gamma, fields[mesh.quads])

    states = {name: homogeneous(mesh, name) for name in ("fp64", "fp32")}
    return Result(
        mesh=mesh,
        gradient_error=gradient_error,  # largest |F - F imposed| of an element [-]
        # largest interior force of a unit homogeneous stress over the largest corner force [-]
        weak_error=weak_error,
        # largest |gamma . field| for the fields 1, R and Y, each of size 1 [-].
        hourglass_error=float(np.abs(hourglass).max()),
        # Largest interior force over the largest corner force, by precision and state [-].
        interior={name: found[0] for name, found in states.items()},
        # Relative error of the force on the lower face against nominal stress times area [-].
        face_force={name: found[1] for name, found in states.items()},
        # Largest force in a shift by a tenth of the length, over mu R^2, by precision [-].
        rigid={name: found[2] for name, found in states.items()},
        # power of the damping stress in uniform stretching over its closed form, minus 1 [-]
        rate_power=rate_power(mesh),
    )


def shown(result: Result) -> dict[str, object]:
    """What the page and the index show beside the fields of the result."""
    rows = [
        [
            f"{state}, a = {a:g}, b = {b:g}",
            *(f"{result.interior[name][state]:.1e}" for name in TOLERANCE),
            *(f"{result.face_force[name][state]:.1e}" for name in TOLERANCE),
        ]
        for state, (a, b) in STRETCH.items()
    ]
    header = ["state", "interior, fp64", "interior, fp32", "face force, fp64", "face force, fp32"]
    return locals()


LINEAR = 1e-13  # sums of a few products of order one: 2e-16 times the number of terms


def test_fields_and_stresses_without_a_modulus_are_exact() -> None:
    assert case().gradient_error < LINEAR
    assert case().weak_error < LINEAR
    assert case().hourglass_error < LINEAR
    assert abs(case().rate_power) < LINEAR


@pytest.mark.parametrize("precision", ["fp64", "fp32"])
@pytest.mark.parametrize("state", list(STRETCH))
def test_patch_through_the_kernel(precision: str, state: str) -> None:
    result = case()
    assert result.interior[precision][state] < TOLERANCE[precision]
    assert result.face_force[precision][state] < TOLERANCE[precision]


@pytest.mark.parametrize("precision", ["fp64", "fp32"])
def test_rigid_shift_and_rigid_velocity_give_no_force(precision: str) -> None:
    assert case().rigid[precision] < TOLERANCE[precision]
