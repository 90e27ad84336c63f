"""Contact of two surfaces and of a rigid sphere, with Hertz's force."""

from dataclasses import replace

import numpy as np
import pytest

from explicit.arrays import FloatArray
from explicit.materials import LAWS
from kolsky.equilibrium.meshes import Mesh, box, grid, rectangle
from kolsky.equilibrium.model import Condition, Fixed, Model, Prescribed, RigidSurface, SelfContact
from kolsky.equilibrium.sensitivity import direct
from kolsky.equilibrium.solid import Isotropic, bulk
from kolsky.equilibrium.solution import Outcome
from kolsky.equilibrium.solve import Newton, solve
from kolsky.equilibrium.surface_contact import SurfaceContact, surface_contacts

# Contact of two surfaces: derivatives, a homogeneous state, a rigid plane, Hertz's cylinders.

MU, K = 2e5, 4e5
RUBBER = Isotropic(LAWS["neo_hookean"].of([MU]), bulk(K))


def joined(lower: Mesh, upper: Mesh) -> Mesh:
    """Two meshes in one; the sets of the upper one begin with "upper_"."""
    n = len(lower.points)
    sets = dict(lower.sets) | {f"upper_{name}": nodes + n for name, nodes in upper.sets.items()}
    return Mesh(
        np.concatenate([lower.points, upper.points]),
        np.concatenate([lower.cells, upper.cells + n]),
        lower.kind,
        sets,
    )


def blocks(kind: str, *, gap: float, other: tuple[int, ...] = (2, 1, 1), seed: int | None = None) -> Mesh:
    """Two unit blocks with a gap between them along the second axis, points moved at random by `seed`."""
    d = 3 if kind.startswith(("hex", "tet")) else 2
    lower = box((1.0,) * d, (2, 1, 1)[:d], kind=kind)
    upper = box((1.0,) * d, other[:d], kind=kind)
    upper = replace(upper, points=upper.points + np.eye(d)[1] * (1.0 + gap))
    mesh = joined(lower, upper)
    if seed is not None:
        rng = np.random.default_rng(seed)
        mesh = replace(mesh, points=mesh.points + 0.02 * rng.standard_normal(mesh.points.shape))
    return mesh


@pytest.mark.parametrize("kind", ["quad9", "tri6", "hex8", "tet10"])
def test_forces_and_stiffness_are_derivatives_of_the_potential(kind: str) -> None:
    mesh = blocks(kind, gap=-0.1, seed=4)  # bent faces that lie in one another
    model = Model(mesh, RUBBER, kinematics="3d" if mesh.dimension == 3 else "plane_strain")
    contact = SurfaceContact(model, SelfContact("top", "upper_bottom"))
    u, h = np.zeros(model.n_dofs), 1e-6
    assert contact.force(u) > 0.0
    rng = np.random.default_rng(1)
    v = rng.standard_normal(len(u))
    ends = [contact.potential(u + s * h * v) for s in (-1.0, 1.0)]
    assert -contact.forces(u) @ v == pytest.approx((ends[1] - ends[0]) / (2.0 * h), rel=1e-5)
    change = (contact.forces(u - h * v) - contact.forces(u + h * v)) / (2.0 * h)
    pairs, stiff = contact.blocks(u)
    d = mesh.dimension
    dofs = (contact.nodes_of(pairs)[..., None] * d + np.arange(d)).reshape(len(pairs), -1)
    product = np.zeros(len(u))
    np.add.at(product, dofs, np.einsum("pij,pj->pi", stiff, v[dofs]))
    assert product == pytest.approx(change, abs=1e-5 * np.abs(change).max())
    # opposite and equal, and without a moment: two bodies that nothing else touches
    pushed = contact.forces(u).reshape(-1, d)
    size = np.abs(pushed).sum()
    assert np.abs(pushed.sum(axis=0)).max() < 1e-12 * size
    if d == 3:
        assert np.abs(np.cross(mesh.points, pushed).sum(axis=0)).max() < 1e-8 * size


def pressed(kind: str, *, gap: float, other: tuple[int, ...] = (2, 1, 1), **options: float) -> Model:
    mesh = blocks(kind, gap=gap, other=other)
    d = mesh.dimension
    sides = np.arange(len(mesh.points))
    mesh = mesh.with_set("every", sides)
    held = tuple(axis for axis in range(d) if axis != 1)
    conditions = (
        Fixed("bottom", (1,)),
        Fixed("every", held),
        Prescribed("upper_top", 1, "press"),
        SelfContact("top", "upper_bottom", **options),  # type: ignore[arg-type]
    )
    return Model(mesh, RUBBER, conditions, kinematics="3d" if d == 3 else "plane_strain")


@pytest.mark.parametrize(("kind", "other"), [("hex27", (2, 1, 1)), ("quad9", (2, 1)), ("quad9", (3, 1))])
def test_two_blocks_are_one(kind: str, other: tuple[int, ...]) -> None:
    model = pressed(kind, gap=0.05, other=other)
    run = solve(model, {"press": [-0.04, -0.25]})
    assert run.outcome.ok
    assert run.reaction("bottom")[0, 1] == pytest.approx(0.0, abs=1e-9)
    # confined compression of both: P = mu J^(-2/3) (l - I1/(3 l)) + K (l - 1), and what the penalty gives
    stiffness = sum(contact.stiffness for contact in surface_contacts(model))
    stretch = np.linspace(0.5, 1.0, 5001)
    first = stretch**2 + 2.0
    stress = MU * stretch ** (-2.0 / 3.0) * (stretch - first / (3.0 * stretch)) + K * (stretch - 1.0)
    travel = 0.05 + 2.0 * (1.0 - stretch) - stress / stiffness
    wanted = np.interp(0.25, travel[::-1], -stress[::-1])
    # another mesh on the other side: points of the first do not integrate the second's shape functions
    tolerance = 1e-6 if other[0] == 2 else 1e-3
    assert run.reaction("bottom")[1, 1] == pytest.approx(wanted, rel=tolerance)


def test_cylinders_touch_as_hertz_says() -> None:
    size, radius, travel = 1.0, 5.0, 7e-4
    fine = np.concatenate([np.linspace(0.0, 0.06, 7), np.geomspace(0.07, size, 8)])
    lower = grid((fine, -fine[::-1]), np.ones((14, 14), dtype=bool), kind="quad9")
    x, y = lower.points.T
    bent = y - x**2 / (2.0 * radius) * (1.0 + y / size)
    lower = replace(lower, points=np.column_stack([x, bent]))
    turned = lower.cells[:, [3, 2, 1, 0, 6, 5, 4, 7, 8]]
    upper = replace(lower, points=lower.points * [1.0, -1.0], cells=turned)
    conditions = (
        Fixed("left", (0,)), Fixed("upper_left", (0,)), Fixed("bottom", (1,)),
        Prescribed("upper_bottom", 1, "press"), SelfContact("top", "upper_top", penalty=5e3),
    )  # fmt: skip
    model = Model(joined(lower, upper), RUBBER, conditions, kinematics="plane_strain")
    run = solve(model, {"press": [-2.0 * travel]})
    assert run.outcome.ok
    contact, turned = surface_contacts(model)
    u = run.displacements[0].ravel()
    found = 2.0 * contact.pressures(u)  # by symmetry both ways press alike
    assert turned.force(u) == pytest.approx(contact.force(u), rel=1e-6)
    force = 4.0 * contact.force(u)  # half of the cylinders is modelled
    young = 9.0 * K * MU / (3.0 * K + MU)
    poisson = (3.0 * K - 2.0 * MU) / (2.0 * (3.0 * K + MU))
    both = young / (2.0 * (1.0 - poisson**2))
    width = np.sqrt(4.0 * force * 0.5 * radius / (np.pi * both))
    assert 0.03 < width < 0.06
    places = np.einsum("gk,fk->fg", contact.values, model.mesh.points[contact.first, 0]).ravel()
    wanted = 2.0 * force / (np.pi * width) * np.sqrt(np.maximum(0.0, 1.0 - (places / width) ** 2))
    inside = places < 0.85 * width
    # the block is 20 times as large as the contact: the half space is left by some 1/20^2
    assert found[0] == pytest.approx(wanted[0], rel=5e-3)
    # towards the edge it falls as a square root, which elements of a fifth of the width follow to O(h)
    assert found[inside] == pytest.approx(wanted[inside], abs=0.04 * wanted[0])
    assert places[found > 0.0].max() == pytest.approx(width, abs=0.01)


def test_mirrored_blocks_touch_as_one_does_a_plane() -> None:
    bump = rectangle((1.0, 0.5), (6, 2), kind="quad9")
    x, y = bump.points.T
    bump = replace(bump, points=np.column_stack([x, y + 0.1 * (y / 0.5) * np.sin(np.pi * x)]))
    rest = (Fixed("bottom", (0,)), Prescribed("bottom", 1, "rise"))
    plane = RigidSurface("top", (0.0, -1.0), (0.0, 0.62), tolerance=1e-4)
    one = solve(Model(bump, RUBBER, (*rest, plane), kinematics="plane_strain"), {"rise": [0.06]})
    flipped = bump.points * [1.0, -1.0] + [0.0, 1.24]
    turned = bump.cells[:, [3, 2, 1, 0, 6, 5, 4, 7, 8]]
    both = joined(bump, replace(bump, points=flipped, cells=turned))
    conditions = (*rest, Fixed("upper_bottom", (0,)), Prescribed("upper_bottom", 1, "rise", -1.0))
    contact = SelfContact("top", "upper_top")
    two = solve(Model(both, RUBBER, (*conditions, contact), kinematics="plane_strain"), {"rise": [0.06]})
    assert one.outcome.ok
    assert two.outcome.ok
    force = one.reaction("bottom")[0, 1]
    # points that touch are nodes here and points of integration there: the edge of the contact differs by a
    # share of an element
    assert two.reaction("bottom")[0, 1] == pytest.approx(force, rel=0.02)


def test_an_equilibrium_that_is_too_deep_is_none() -> None:
    model = pressed("quad9", gap=0.05, penalty=7.5)
    assert solve(model, {"press": [-0.25]}).outcome is Outcome.PENETRATION
    assert solve(pressed("quad9", gap=0.05, penalty=7.5, depth=0.04), {"press": [-0.25]}).outcome.ok


def test_derivatives_of_a_solution_in_contact() -> None:
    model = pressed("quad9", gap=0.05)
    moved = [solve(model, {"press": [-0.25]}, [s * MU, K]).reaction("bottom")[0, 1] for s in (0.999, 1.001)]
    found = direct(solve(model, {"press": [-0.25]}))
    assert -found.reaction("upper_top")[0, 0, 1] == pytest.approx(
        (moved[1] - moved[0]) / (0.002 * MU), rel=1e-4
    )


def test_contact_is_in_the_factors() -> None:
    # the last iterations towards an equilibrium in contact are quadratic with it, and stall without
    model = pressed("quad9", gap=0.05, other=(2, 1))
    run = solve(model, {"press": [-0.25]}, newton=Newton(single=False))
    assert run.outcome.ok
    assert run.iterations <= 15


# A rigid sphere pressed on a body: Hertz's force, with the bonded layer's correction for a finite height.

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
