"""A rigid sphere pressed on a body: Hertz's force, with the bonded layer's correction for a finite height."""

from dataclasses import replace

import numpy as np
import pytest

from explicit.arrays import FloatArray
from explicit.materials import LAWS
from kolsky.equilibrium.meshes import Mesh, rectangle
from kolsky.equilibrium.model import Condition, Fixed, Model, RigidSurface
from kolsky.equilibrium.sensitivity import direct
from kolsky.equilibrium.solid import Isotropic, bulk
from kolsky.equilibrium.solve import Newton, solve

INDENTATION_MU = 1e4
TRAVEL = 5e-6 * np.linspace(0.3, 1.0, 6)
RADIUS, HEIGHT = 0.1, 5e-3


def layer_force(nu: float, radius: float, height: float, depth: FloatArray) -> FloatArray:
    """Force of a sphere on a bonded layer [N]: Dimitriadis et al. (2002); for a great height Hertz's."""
    young = 2.0 * INDENTATION_MU * (1.0 + nu)
    a = -(1.2876 - 1.4678 * nu + 1.3442 * nu**2) / (1.0 - nu)
    b = (0.6387 - 1.0277 * nu + 1.5164 * nu**2) / (1.0 - nu)
    x = np.sqrt(radius * depth) / height / np.pi
    hertz = 4.0 / 3.0 * young / (1.0 - nu**2) * np.sqrt(radius) * depth**1.5
    third, fourth = a**3 + 4.0 * np.pi**2 / 15.0 * b, a**3 + 3.0 * np.pi**2 / 5.0 * b
    return np.asarray(
        hertz * (1.0 - 2.0 * a * x + 4.0 * (a * x) ** 2 - 8.0 * third * x**3 + 16.0 * a * fourth * x**4)
    )


def indentation_pressed(n: int, nu: float, *, height: float = HEIGHT, mixed: bool = False) -> Model:
    """A cylinder of n x n elements under a sphere, finest where it touches, glued at its foot."""
    unit = rectangle((1.0, 1.0), (n, n), kind="quad9")
    ticks = np.linspace(0.0, 1.0, 2 * n + 1) ** 2
    ticks[1::2] = 0.5 * (ticks[:-1:2] + ticks[2::2])
    at = np.round(unit.points * 2 * n).astype(int)
    points = np.column_stack([2.0 * height * ticks[at[:, 0]], -height * ticks[2 * n - at[:, 1]]])
    solid = Isotropic(
        LAWS["neo_hookean"].of([INDENTATION_MU]),
        bulk(2.0 * INDENTATION_MU * (1.0 + nu) / (3.0 * (1.0 - 2.0 * nu))),
    )
    sphere = RigidSurface("top", (0.0, -2.0), (0.0, 0.0), "d", -1.0, RADIUS)
    conditions: tuple[Condition, ...] = (Fixed("left", (0,)), Fixed("bottom"), sphere)
    mesh: Mesh = replace(unit, points=points)
    volumetric = "mixed" if mixed else "displacement"
    return Model(mesh, solid, conditions, kinematics="axisymmetric", volumetric=volumetric)


@pytest.mark.parametrize(
    ("nu", "height", "mixed", "sizes"),
    [
        (0.3, HEIGHT, False, (6, 12, 24)),
        pytest.param(0.4999, HEIGHT, True, (8, 16, 32), marks=pytest.mark.slow),
        pytest.param(0.3, 10.0 * HEIGHT, False, (8, 16, 32), marks=pytest.mark.slow),
    ],
)
def test_a_sphere_has_the_force_of_hertz(
    nu: float, height: float, mixed: bool, sizes: tuple[int, ...]
) -> None:
    # Depths of 5e-5 radii: the strains of 0.7 % leave the linear law by some tenths of a per cent. At K / mu
    # of 5000 the round-off of the pressure is 1e-7 of the small forces.
    deep = TRAVEL if height == HEIGHT else 10.0 * TRAVEL
    newton = Newton(tolerance=1e-6 if mixed else 1e-8)
    expected = layer_force(nu, RADIUS, height, deep)
    errors = []
    for n in sizes:
        model = indentation_pressed(n, nu, height=height, mixed=mixed)
        found = solve(model, {"d": -deep}, newton=newton)
        assert found.outcome.ok
        errors.append(-found.reaction("top")[:, 1] / expected - 1.0)
        depth = deep + found.displacements[:, model.mesh.nodes("top"), 1].min(axis=1)
        assert np.abs(depth).max() < 1.1e-6 * 2.0 * height  # the axis is pressed as deep as the sphere
    # points come into contact one by one, so the error is uneven; it falls with the size of the elements
    rms = np.sqrt(np.mean(np.square(errors), axis=1))
    order = -np.polyfit(np.log(sizes), np.log(rms), 1)[0]
    assert order > 0.8
    assert rms[-1] < 0.01
    assert abs(np.mean(errors[-1])) < 0.005


def test_derivatives_of_an_indentation_are_differences() -> None:
    model = indentation_pressed(4, 0.3)
    tight, d = Newton(tolerance=1e-12), -1e-3  # a tenth of the radius: the normals turn
    sphere = RigidSurface("top", (0.0, -1.0), (0.0, 0.0), "d", -1.0, 0.01, tolerance=1e-10)
    small = replace(model, conditions=(*model.conditions[:2], sphere))
    found = direct(solve(small, {"d": [d]}, newton=tight), histories=("d",))
    own = found.reaction("top")[0]

    def force(parameters: FloatArray | None = None, travel: float = d) -> FloatArray:
        return np.asarray(solve(small, {"d": [travel]}, parameters, newton=tight).reaction("top")[0])

    table = model.parameters()[0]
    for j, value in enumerate(table):
        step = 1e-4 * value * np.eye(len(table))[j]
        changed = (force(table + step) - force(table - step)) / 2e-4
        np.testing.assert_allclose(own[j] * value, changed, rtol=1e-5)  # the curvature over a step is 1e-8
    by_travel = (force(travel=d + 1e-7) - force(travel=d - 1e-7)) / 2e-7
    np.testing.assert_allclose(own[-1], by_travel, rtol=1e-5)
