"""Equilibria: a thick cylinder, Cook's membrane, inf-sup constants, and another program's forces."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.linalg
from numpy.typing import NDArray
from order import assert_order, fitted_order

from explicit.materials import LAWS
from kolsky.equilibrium.body import Body
from kolsky.equilibrium.meshes import box, rectangle
from kolsky.equilibrium.model import Fixed, Model, Prescribed, Pressure, Traction
from kolsky.equilibrium.points import element_stiffness
from kolsky.equilibrium.solid import Isotropic, bulk
from kolsky.equilibrium.solve import Newton, solve

FloatArray = NDArray[np.float64]

SHEAR = 25e3  # of the rubbers here [Pa]
INNER, OUTER, REACHED = 1.0, 2.0, 1.5  # radii of the thick cylinder, and the inner one under its pressure [m]
NEARLY = 1e7  # bulk over shear modulus of the cylinder, whose closed form is incompressible
PEER_FORCES = (1.91994687, 3.27886483, 4.36322188, 5.29174569, 6.12069051)
"""Forces [N] of FElupe 11.3.0 on 6 x 3 x 1 27-node hexahedra, in five steps to 125 % at nu = 0.45:
``python -m benchmarks.equilibrium --cells 6x3x1 --steps 5 --json FILE``."""

MEMBRANE_OF_PEER = Path(__file__).resolve().parent.parent / "reference" / "L_cook.csv"
"""Cook's membrane by `tests/reference/L_dolfinx.py`."""


def nearly_incompressible(ratio: float, shear: float = SHEAR) -> Isotropic:
    """A neo-Hookean law with K = ratio times the shear modulus."""
    return Isotropic(LAWS["neo_hookean"].of([shear]), bulk(ratio * shear))


def cylinder_error(kind: str, across: int) -> float:
    """Relative error of the inner radius of a thick cylinder under internal pressure."""
    a, b = REACHED, np.sqrt(OUTER**2 + REACHED**2 - INNER**2)
    logarithm = np.log(a * OUTER / (INNER * b))
    p = SHEAR * (logarithm + 0.5 * (a**2 - INNER**2) * (1.0 / a**2 - 1.0 / b**2))
    mesh = rectangle((OUTER - INNER, 0.1), (across, 1), kind=kind)
    mesh = replace(mesh, points=mesh.points + np.array([INNER, 0.0]))
    conditions = (Fixed("bottom", (1,)), Fixed("top", (1,)), Pressure("left", "p"))
    model = Model(
        mesh, nearly_incompressible(NEARLY), conditions, kinematics="axisymmetric", volumetric="mixed"
    )
    found = solve(model, {"p": p * np.array([0.3, 0.6, 0.8, 0.9, 1.0])}, newton=Newton(1e-11))
    return float(abs((INNER + found.mean_displacement("left")[-1, 0]) / a - 1.0))


def cook(kind: str, cells: int, volumetric: str) -> float:
    """Rise of the upper right corner of Cook's membrane [mm]: mu = 80.1938 MPa, K = 5000 mu, 100 N on the
    right edge, plane strain of thickness 1 mm (Simo and Armero 1992, Section 4.2); NaN if it fails."""
    mesh = rectangle((1.0, 1.0), (cells, cells), kind=kind)
    x, y = mesh.points.T
    lower, upper = 44.0 * x, 44.0 + 16.0 * x
    mesh = replace(mesh, points=np.column_stack([48.0 * x, lower + (upper - lower) * y]))
    mu = 80.1938  # N/mm^2, and lengths in mm
    conditions = (Fixed("left"), Traction("right", 1, "t"))
    model = Model(
        mesh,
        nearly_incompressible(5000.0, mu),
        conditions,
        kinematics="plane_strain",
        volumetric=volumetric,  # type: ignore[arg-type]
    )
    found = solve(model, {"t": 100.0 / 16.0 * np.array([0.25, 0.5, 0.75, 1.0])})
    corner = int(np.argmax(mesh.points.sum(axis=1)))
    return float(found.displacements[-1, corner, 1])


def cook_of_dolfinx() -> dict[int, float]:
    """The same of DOLFINx by cells along an edge, at 0 the limit of the last three by Aitken's rule [mm]."""
    table = np.loadtxt(MEMBRANE_OF_PEER, delimiter=",")
    a, b, c = table[-3:, 1]
    return {int(n): float(rise) for n, rise in table} | {0: float(c - (c - b) ** 2 / (c - 2.0 * b + a))}


def inf_sup(kind: str, cells: int) -> float:
    """The inf-sup constant of an element's displacement and pressure on a clamped unit square or cube.

    It is the root of the smallest eigenvalue of G x = beta^2 S x that belongs to a pressure: of the pressures
    all but the constant one should have a positive one (Chapelle and Bathe 1993).
    """
    d = 2 if kind.startswith(("quad", "tri")) else 3
    mesh = box((1.0,) * d, (cells,) * d, kind=kind)
    sides = ("left", "right", "bottom", "top", "back", "front")[: 2 * d]
    model = Model(
        mesh, nearly_incompressible(1.0), tuple(Fixed(side) for side in sides),
        kinematics="plane_strain" if d == 2 else "3d", volumetric="mixed",
    )  # fmt: skip
    body = Body(model, model.parameters())
    geometry, field = body.points.geometry, body.field
    assert field is not None
    m, g = geometry.volumes.shape
    trace = np.tile(np.eye(d).ravel(), (m, g, 1))
    unit = np.tile(np.eye(d * d), (m, g, 1, 1)) * geometry.volumes[..., None, None]
    G = body.pattern.matrix(field.stiffness(trace, np.ones((m, g)))).toarray()
    S = body.pattern.matrix(element_stiffness(geometry.T, unit)).toarray()
    values = np.sort(scipy.linalg.eigvalsh(G, S))[::-1]
    pressures = m * field.phi.shape[1] - 1
    if pressures > len(values):
        return 0.0  # more pressures than displacements
    return float(np.sqrt(max(values[pressures - 1], 0.0)))


def strip_forces() -> FloatArray:
    """Forces [N] of the strip of `PEER_FORCES`, its middle plane kept flat as the peer's stays.

    A thin strip between clamps may wrinkle as it is pulled: from the third step on there is an equilibrium
    beside the flat one, 0.04 to 0.2 % softer, and round-off decides which of them is found.
    """
    solid = Isotropic(LAWS["neo_hookean"].of([SHEAR]), bulk(SHEAR * 2.0 * 1.45 / (3.0 * 0.1)))
    conditions = (Fixed("left"), Fixed("right", (1, 2)), Prescribed("right", 0, "pull"))
    strip = box((0.1, 0.025, 0.005), (6, 3, 1)).with_set("middle", lambda x: np.isclose(x[:, 2], 0.0025))
    model = Model(strip, solid, (*conditions, Fixed("middle", (2,))))
    return np.asarray(solve(model, {"pull": 0.025 * np.arange(1, 6)}).reaction("right")[:, 0])


ACROSS = (2, 4, 8)  # elements across the wall, and along an edge of the membrane and the square
ORDERS = {"quad4": 2.0, "quad8": 2.0, "quad9": 4.0, "tri6": 2.0}
"""What theory gives for the radius, which the pressure works on: twice the degree of the displacement, or of
the pressure plus one where that is less."""
ORDER_HELD = 0.3  # distance from it that is allowed over three meshes
MEMBRANE = (
    ("quad4", "displacement"), ("quad4", "mixed"), ("quad8", "mixed"), ("tri6", "mixed"), ("quad9", "mixed"),
)  # fmt: skip
FINE = 16  # elements along an edge with which the membrane is compared with another program
TIP_HELD = 0.005
"""Largest relative distance from its limit of the 9-node quadrilateral and the 6-node triangle, `FINE`: their
own steps from 8 to 16 elements are 0.2 and 0.4 %."""
SQUARES = ("quad4", "quad8", "quad9", "tri6")
STABLE = ("quad8", "quad9", "tri6")
FALL = 0.2  # largest relative fall of the inf-sup constant of a stable element from 2 to 8 elements
PEER_HELD = 1e-3  # largest relative difference of forces from another program's


Result = SimpleNamespace


@cache
def case() -> Result:
    """Run everything."""
    cylinder = {kind: [cylinder_error(kind, n) for n in ACROSS] for kind in ORDERS}
    return Result(
        cylinder=cylinder,  # relative errors of the inner radius, by element and mesh [-]
        # their fitted orders
        orders={kind: fitted_order(1.0 / np.array(ACROSS), e) for kind, e in cylinder.items()},
        # rise of the corner by element, formulation and mesh [mm]
        membrane={(kind, how): [cook(kind, n, how) for n in ACROSS] for kind, how in MEMBRANE},
        # the same of mixed elements on `FINE` x `FINE`, by element [mm]
        fine={kind: cook(kind, FINE, "mixed") for kind in ("quad9", "tri6")},
        membrane_of_peer=cook_of_dolfinx(),  # that of DOLFINx by cells along an edge, and at 0 its limit [mm]
        # Inf-sup constants by element and mesh [-]
        constants={kind: [inf_sup(kind, n) for n in ACROSS] for kind in SQUARES},
        # those of hexahedra on 3 x 3 x 3 elements [-]
        solid_constants={kind: inf_sup(kind, 3) for kind in ("hex8", "hex27")},
        # largest relative difference from the peer's forces [-]
        peer=float(np.abs(strip_forces() / np.array(PEER_FORCES) - 1.0).max()),
    )


def tip_errors(result: Result) -> dict[str, float]:
    """Relative distance of the corner's rise on `FINE` elements from DOLFINx's limit, by element [-]."""
    return {kind: abs(rise / result.membrane_of_peer[0] - 1.0) for kind, rise in result.fine.items()}


def shown(result: Result) -> dict[str, object]:
    """What the page and the index show beside the fields of the result."""
    cylinder = "\n".join(
        f"| {kind} | {' | '.join(f'{e:.1e}' for e in errors)} | {result.orders[kind].order:.2f} ± "
        f"{result.orders[kind].standard_error:.2f} | {ORDERS[kind]:.0f} |"
        for kind, errors in result.cylinder.items()
    )
    membrane = "\n".join(
        f"| {kind}, {how} | {' | '.join(f'{x:.3f}' for x in rises)} |"
        for (kind, how), rises in result.membrane.items()
    )
    constants = "\n".join(
        f"| {kind} | {' | '.join(f'{x:.3f}' for x in values)} |" for kind, values in result.constants.items()
    )
    solids = ", ".join(f"{kind}: {value:.3f}" for kind, value in result.solid_constants.items())
    peers = {n: rise for n, rise in result.membrane_of_peer.items() if n}
    peer, cells = (", ".join(values) for values in ((f"{r:.3f}" for r in peers.values()), map(str, peers)))
    fine = " and ".join(
        f"{kind} has {result.fine[kind]:.3f} mm, {100 * error:.2f} % from it"
        for kind, error in tip_errors(result).items()
    )
    orders = ", ".join(f"{result.orders[kind].order:.2f}" for kind in ORDERS)
    return locals()


pytestmark = pytest.mark.slow


@pytest.mark.parametrize("kind", list(ORDERS))
def test_order_of_the_thick_cylinder(kind: str) -> None:
    errors = case().cylinder[kind]
    sizes = [1.0 / n for n in ACROSS]
    assert_order(sizes, errors, ORDERS[kind], ORDER_HELD)


def test_cooks_membrane() -> None:
    membrane = case().membrane
    errors = tip_errors(case())
    assert max(errors.values()) < TIP_HELD, errors
    assert membrane["quad4", "displacement"][-1] < 0.5 * membrane["quad4", "mixed"][-1]  # it locks


def test_inf_sup_constants() -> None:
    result = case()
    for kind in STABLE:
        values = result.constants[kind]
        assert values[-1] > (1.0 - FALL) * values[0] > 0.0
    assert result.constants["quad4"][-1] < 1e-6  # the chessboard
    assert result.solid_constants["hex8"] < 1e-6 < result.solid_constants["hex27"]
    assert inf_sup("hex27", 2) == pytest.approx(result.solid_constants["hex27"], rel=FALL)


def test_forces_of_another_program() -> None:
    assert case().peer < PEER_HELD
