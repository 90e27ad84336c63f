"""Equilibria with an answer in closed form."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from explicit.materials import LAWS
from kolsky.equilibrium.elements import ELEMENTS
from kolsky.equilibrium.meshes import Mesh, box, cross, dog_bone, rectangle
from kolsky.equilibrium.model import (
    Coupled,
    Fixed,
    Gravity,
    Model,
    NodalForce,
    Prescribed,
    Pressure,
    RigidSurface,
    Traction,
)
from kolsky.equilibrium.solid import CompressibleNeoHookean, Isotropic, bulk
from kolsky.equilibrium.solve import solve
from tests.unit.equilibrium.models import MOONEY, TIGHT, sliding

COUPLED = CompressibleNeoHookean(9e3, 4e4)


def uniaxial(solid: CompressibleNeoHookean, stretch: float) -> tuple[float, float]:
    """Nominal stress [Pa] and lateral stretch of the coupled energy in uniaxial tension, by a root search."""

    def side(lateral: float) -> float:
        J = stretch * lateral**2
        return solid.mu * (lateral - 1.0 / lateral) + solid.lam * np.log(J) / lateral

    lateral = brentq(side, 0.2, 2.0, xtol=1e-15)
    log = np.log(stretch * lateral**2)
    return solid.mu * (stretch - 1.0 / stretch) + solid.lam * log / stretch, lateral


@pytest.mark.parametrize(("kind", "kinematics"), [("hex8", "3d"), ("quad9", "plane_stress")])
def test_uniaxial_tension(kind, kinematics):
    pull = (Prescribed("right", 0, "pull"),)
    model = sliding(kind, kinematics, pull, solid=COUPLED, **({"thickness": 0.5} if kind == "quad9" else {}))
    found = solve(model, {"pull": [0.4, 1.0]}, newton=TIGHT)
    for step, stretch in enumerate((1.4, 2.0)):
        stress, lateral = uniaxial(COUPLED, stretch)
        area = 0.5 if kind == "quad9" else 1.0
        assert found.reaction("right")[step, 0] == pytest.approx(area * stress, rel=1e-10)
        assert found.mean_displacement("top")[step, 1] == pytest.approx(lateral - 1.0, rel=1e-10)


def test_a_coupled_force_gives_the_stretch_of_its_stress():
    stress, lateral = uniaxial(COUPLED, 1.7)
    model = sliding("quad9", "plane_stress", (Coupled("right", 0, "f"),), solid=COUPLED, thickness=2.0)
    found = solve(model, {"f": [2.0 * stress]}, newton=TIGHT)
    assert found.mean_displacement("right")[0, 0] == pytest.approx(0.7, rel=1e-10)
    assert np.ptp(found.displacements[0, model.mesh.nodes("right"), 0]) == 0.0
    assert found.mean_displacement("top")[0, 1] == pytest.approx(lateral - 1.0, rel=1e-10)
    spread = sliding("quad9", "plane_stress", (Traction("right", 0, "t"),), solid=COUPLED, thickness=2.0)
    found = solve(spread, {"t": [stress]}, newton=TIGHT)
    assert np.ptp(found.displacements[0, model.mesh.nodes("right"), 0]) < 1e-12
    assert found.mean_displacement("right")[0, 0] == pytest.approx(0.7, rel=1e-10)
    assert found.reaction("right")[0, 0] == pytest.approx(2.0 * stress, rel=1e-10)
    dead = sliding("quad4", "plane_stress", (NodalForce("right", 0, "f"),), solid=COUPLED, thickness=2.0)
    found = solve(dead, {"f": [2.0 * stress]}, newton=TIGHT)  # equal shares are those of a linear edge
    assert found.mean_displacement("right")[0, 0] == pytest.approx(0.7, rel=1e-10)


def test_weight_is_what_the_support_carries():
    mesh = rectangle((0.2, 0.1), (2, 2), kind="quad9")
    conditions = (Fixed("bottom"), Gravity(1070.0, (0.0, -9.81)))
    found = solve(Model(mesh, COUPLED, conditions, kinematics="plane_strain", thickness=0.03), newton=TIGHT)
    weight = 1070.0 * 9.81 * 0.2 * 0.1 * 0.03
    np.testing.assert_allclose(found.reaction("bottom")[0], [0.0, weight], atol=1e-9 * weight)
    assert (found.displacements[0, mesh.nodes("top"), 1] < 0.0).all()
    half = (Fixed("bottom"), Gravity(1070.0, (0.0, -9.81), "g"))
    found = solve(Model(mesh, COUPLED, half, kinematics="plane_strain", thickness=0.03), {"g": [0.5]})
    assert found.reaction("bottom")[0, 1] == pytest.approx(0.5 * weight, rel=1e-6)


@pytest.mark.parametrize("kinematics", ["plane_strain", "3d"])
def test_a_follower_pressure_presses_on_the_deformed_face(kinematics):
    # Slid between frictionless walls and held in width at lam, the top face has grown by lam (lam^1 in 3-D
    # too, whose third direction is held at 1): P_22 = -p times that.
    stretch = 1.5
    top = (Prescribed("right", 0, "pull"), Pressure("top", "p"))
    extra = (*top, Fixed("front", (2,))) if kinematics == "3d" else top
    model = sliding("hex8" if kinematics == "3d" else "quad9", kinematics, extra, solid=COUPLED)
    p = 2e3
    found = solve(model, {"pull": [stretch - 1.0], "p": [p]}, newton=TIGHT)

    def top_stress(y: float) -> float:
        return COUPLED.mu * (y - 1.0 / y) + COUPLED.lam * np.log(stretch * y) / y + p * stretch

    y = brentq(top_stress, 0.1, 2.0, xtol=1e-15)
    assert found.mean_displacement("top")[0, 1] == pytest.approx(y - 1.0, rel=1e-9)
    np.testing.assert_allclose(np.ptp(found.displacements[0, model.mesh.nodes("top"), 1]), 0.0, atol=1e-10)


def test_a_rigid_plane_is_a_prescribed_face():
    plane = RigidSurface("right", (-2.0, 0.0), (1.0, 0.5), "push", tolerance=1e-10)
    found = solve(sliding(extra=(plane,), solid=COUPLED), {"push": [0.1, 0.3]}, newton=TIGHT)
    for step, stretch in enumerate((0.9, 0.7)):
        stress, lateral = uniaxial(COUPLED, stretch)
        assert found.contact_forces[0][step].sum() == pytest.approx(-stress, rel=1e-7)
        assert found.mean_displacement("top")[step, 1] == pytest.approx(lateral - 1.0, rel=1e-7)
        np.testing.assert_allclose(found.displacements[step, :, 0].min(), stretch - 1.0, rtol=1e-8)


def test_a_plane_that_is_not_reached_does_nothing():
    plane = RigidSurface("right", (-1.0, 0.0), (2.0, 0.0), "push")
    model = sliding(extra=(plane, Coupled("top", 1, "f")), solid=COUPLED)
    found = solve(model, {"push": [0.2], "f": [1e3]})
    assert (found.contact_forces[0] == 0.0).all()
    assert found.mean_displacement("right")[0, 0] < 0.0


def test_thick_cylinder_under_pressure():
    # Incompressible neo-Hookean in plane strain, radii A, B -> a, b with b^2 - B^2 = a^2 - A^2:
    # p = mu (ln(a B / (A b)) + (a^2 - A^2) / 2 (1 / a^2 - 1 / b^2))
    mu, A, B, a = 1e4, 1.0, 2.0, 1.5
    b = np.sqrt(B**2 + a**2 - A**2)
    p = mu * (np.log(a * B / (A * b)) + 0.5 * (a**2 - A**2) * (1.0 / a**2 - 1.0 / b**2))
    solid = Isotropic(LAWS["neo_hookean"].of([mu]), bulk(1e5 * mu))
    mesh = rectangle((B - A, 0.2), (6, 1), kind="quad9")
    mesh = replace(mesh, points=mesh.points + np.array([A, 0.0]))
    conditions = (Fixed("bottom", (1,)), Fixed("top", (1,)), Pressure("left", "p"))
    model = Model(mesh, solid, conditions, kinematics="axisymmetric", volumetric="mixed")
    found = solve(model, {"p": p * np.array([0.5, 0.8, 1.0])}, newton=TIGHT)
    # four digits: elements of a sixth of the wall, and K / mu = 1e5
    assert 1.0 + found.mean_displacement("left")[-1, 0] == pytest.approx(a, rel=2e-4)
    assert B + found.mean_displacement("right")[-1, 0] == pytest.approx(b, rel=2e-4)


def test_energy_is_the_work_of_the_grips():
    steps = np.linspace(0.0, 0.4, 9)[1:]
    found = solve(sliding(extra=(Prescribed("right", 0, "pull"),)), {"pull": steps}, newton=TIGHT)
    force = np.concatenate([[0.0], found.reaction("right")[:, 0]])
    fit = np.polynomial.Polynomial.fit(np.concatenate([[0.0], steps]), force, 8)
    work = fit.integ()(0.4) - fit.integ()(0.0)
    assert found.energy[-1] == pytest.approx(work, rel=1e-6)  # of the polynomial of degree 8
    assert MOONEY.shear_modulus == pytest.approx(25e3)


def area(mesh: Mesh) -> float:
    points, weights = mesh.element.rule(mesh.element.gauss)
    jacobian = np.einsum("cki,gkj->cgij", mesh.points[mesh.cells], mesh.element.gradients(points))
    return float((np.linalg.det(jacobian) * weights).sum())


def test_sides_of_a_box():
    mesh = box((2.0, 1.0, 3.0), (2, 1, 1), kind="hex8")
    assert (mesh.points[mesh.nodes("right"), 0] == 2.0).all()
    assert len(mesh.nodes("right")) == 4
    assert len(mesh.nodes("front")) == len(mesh.nodes("bottom")) == 6
    more = mesh.with_set("edge", lambda x: (x[:, 0] == 0.0) & (x[:, 1] == 0.0))
    assert len(more.nodes("edge")) == 2
    with pytest.raises(ValueError, match="has no set 'roof'"):
        mesh.nodes("roof")
    with pytest.raises(ValueError, match="would be empty"):
        mesh.with_set("none", lambda x: x[:, 0] > 9.0)


def test_a_cross_lacks_its_corners():
    mesh = cross((4.0, 4.0), (8, 8), (3, 3), kind="quad9")
    assert area(mesh) == pytest.approx(16.0 - 4 * 1.5**2)
    paper = cross((0.1, 0.1, 0.004), (40, 40, 2), (15, 15), kind="hex8")
    assert len(paper.cells) == 1400  # Schumacher and others 2020, Section V
    with pytest.raises(ValueError, match="corner must leave cells"):
        cross((1.0, 1.0), (4, 4), (2, 1), kind="quad4")


def test_a_dog_bone_has_its_waist():
    mesh = dog_bone((10.0, 4.0), (20, 4), waist=2.0, straight=4.0, kind="quad9")
    middle = mesh.points[np.abs(mesh.points[:, 0] - 5.0) < 1e-9, 1]
    ends = mesh.points[mesh.nodes("left"), 1]
    assert np.ptp(middle) == pytest.approx(2.0)
    assert np.ptp(ends) == pytest.approx(4.0)
    # width falls by a cosine over both ramps: the mean of 2 and 4
    assert area(mesh) == pytest.approx(4.0 * 2.0 + 6.0 * 3.0, rel=1e-3)
    for wrong in ({"waist": 5.0, "straight": 1.0}, {"waist": 1.0, "straight": 10.0}):
        with pytest.raises(ValueError, match="must be in"):
            dog_bone((10.0, 4.0), (4, 2), kind="quad4", **wrong)


@pytest.mark.parametrize("name", sorted(ELEMENTS))
def test_a_mesh_fills_the_size_that_vtk_finds(name):
    pv = pytest.importorskip("pyvista")
    item = ELEMENTS[name]
    mesh = box((1.0, 2.0, 3.0)[: item.dimension], (2, 1, 1)[: item.dimension], kind=name)
    points = np.column_stack([mesh.points, np.zeros((len(mesh.points), 3 - item.dimension))])
    grid = pv.UnstructuredGrid({item.vtk: mesh.cells}, points)
    size = np.asarray(grid.compute_cell_sizes()["Volume" if item.dimension == 3 else "Area"])
    if name not in ("hex27", "quad9"):  # VTK's own sizes of these are of their corners or missing
        assert size.sum() == pytest.approx(area(mesh), rel=1e-6)


def test_what_a_mesh_refuses():
    points, cells = np.zeros((4, 2)), np.array([[0, 1, 2, 3]])
    with pytest.raises(ValueError, match="have 9 points"):
        Mesh(points, cells, "quad9")
    with pytest.raises(ValueError, match=r"shape \[n, 3\]"):
        Mesh(points, np.array([[0, 1, 2, 3]]), "tet4")
    with pytest.raises(ValueError, match=r"in \[0, 3\]"):
        Mesh(points, cells + 1, "quad4")
    with pytest.raises(ValueError, match="finite"):
        Mesh(points * np.nan, cells, "quad4")
    with pytest.raises(ValueError, match="size must be > 0"):
        rectangle((1.0, 0.0), (1, 1))
    with pytest.raises(ValueError, match="needs 3 edge lengths"):
        box((1.0, 1.0), (1, 1))
