"""Equilibria: a thick cylinder, Cook's membrane, inf-sup constants, and another program's forces."""

from dataclasses import dataclass
from functools import cache

import numpy as np
from equilibrium_runs import NEARLY, PEER_FORCES, cook, cook_of_dolfinx, cylinder_error, inf_sup, strip_forces
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator, ScalarFormatter
from order import FittedOrder, fitted_order

TITLE = "Equilibrium elements"
FIGURE_SIZE = (6.7, 2.6)

ACROSS = (2, 4, 8)
"""Elements across the wall, and along an edge of the membrane and the square."""
ORDERS = {"quad4": 2.0, "quad8": 2.0, "quad9": 4.0, "tri6": 2.0}
"""What theory gives for the radius, which the pressure works on: twice the degree of the displacement, or of
the pressure plus one where that is less."""
ORDER_HELD = 0.3
"""Distance from it that is allowed over three meshes."""
MEMBRANE = (
    ("quad4", "displacement"),
    ("quad4", "mixed"),
    ("quad8", "mixed"),
    ("tri6", "mixed"),
    ("quad9", "mixed"),
)
FINE = 16
"""Elements along an edge with which the membrane is compared with another program."""
TIP_HELD = 0.005
"""Largest relative distance from its limit of the 9-node quadrilateral and the 6-node triangle, `FINE`: their
own steps from 8 to 16 elements are 0.2 and 0.4 %."""
COLOURS = {"quad4": "C0", "quad8": "C1", "quad9": "C2", "tri6": "C3"}
SQUARES = ("quad4", "quad8", "quad9", "tri6")
STABLE = ("quad8", "quad9", "tri6")
FALL = 0.2
"""Largest relative fall of the inf-sup constant of a stable element from 2 to 8 elements."""
PEER_HELD = 1e-3
"""Largest relative difference of forces from another program's."""


@dataclass(frozen=True)
class Result:
    """Everything that the page shows."""

    cylinder: dict[str, list[float]]
    """Relative errors of the inner radius, by element and mesh [-]."""
    orders: dict[str, FittedOrder]
    """Their fitted orders."""
    membrane: dict[tuple[str, str], list[float]]
    """Rise of the corner by element, formulation and mesh [mm]."""
    fine: dict[str, float]
    """The same of mixed elements on `FINE` x `FINE`, by element [mm]."""
    membrane_of_peer: dict[int, float]
    """That of DOLFINx by cells along an edge, and at 0 its limit [mm]."""
    constants: dict[str, list[float]]
    """Inf-sup constants by element and mesh [-]."""
    solid_constants: dict[str, float]
    """Those of hexahedra on 3 x 3 x 3 elements [-]."""
    peer: float
    """Largest relative difference from the peer's forces [-]."""


@cache
def case() -> Result:
    """Run everything."""
    cylinder = {kind: [cylinder_error(kind, n) for n in ACROSS] for kind in ORDERS}
    return Result(
        cylinder=cylinder,
        orders={kind: fitted_order(1.0 / np.array(ACROSS), e) for kind, e in cylinder.items()},
        membrane={(kind, how): [cook(kind, n, how) for n in ACROSS] for kind, how in MEMBRANE},
        fine={kind: cook(kind, FINE, "mixed") for kind in ("quad9", "tri6")},
        membrane_of_peer=cook_of_dolfinx(),
        constants={kind: [inf_sup(kind, n) for n in ACROSS] for kind in SQUARES},
        solid_constants={kind: inf_sup(kind, 3) for kind in ("hex8", "hex27")},
        peer=float(np.abs(strip_forces() / np.array(PEER_FORCES) - 1.0).max()),
    )


def tip_errors(result: Result) -> dict[str, float]:
    """Relative distance of the corner's rise on `FINE` elements from DOLFINx's limit, by element [-]."""
    return {kind: abs(rise / result.membrane_of_peer[0] - 1.0) for kind, rise in result.fine.items()}


def row(result: Result) -> tuple[str, str, str]:
    """Line of the index."""
    orders = ", ".join(f"{result.orders[kind].order:.2f}" for kind in ORDERS)
    tip = max(tip_errors(result).values())
    return (
        "equilibria: order of a thick cylinder's radius, nearly incompressible, closed form (quad4, quad8, "
        "quad9, tri6); Cook's membrane, DOLFINx; forces of a bonded strip to 125 %, FElupe",
        f"{orders}; {100 * tip:.1f} %; {result.peer:.0e}",
        f"2, 2, 4, 2 within {ORDER_HELD}; {100 * TIP_HELD:.1f} %; {PEER_HELD:.0e}",
    )


def draw(result: Result, figure: Figure) -> None:
    """Left: error of the thick cylinder's inner radius against the elements across its wall. Middle: rise of
    the corner of Cook's membrane; dashed: displacements alone, which lock. Right: inf-sup constants."""
    left, middle, right = figure.subplots(1, 3)
    for kind, errors in result.cylinder.items():
        left.loglog(
            ACROSS, errors, "o-", color=COLOURS[kind], label=f"{kind}, {result.orders[kind].order:.1f}"
        )
    left.set(xlabel="elements across the wall", ylabel="relative error of the radius", xticks=ACROSS)
    left.xaxis.set_minor_locator(NullLocator())
    left.xaxis.set_major_formatter(ScalarFormatter())
    left.legend()
    for (kind, how), rises in result.membrane.items():
        line = "--" if how == "displacement" else "-"
        middle.plot(ACROSS, rises, "o" + line, color=COLOURS[kind], label=kind if how == "mixed" else None)
    middle.set(
        xlabel="elements along an edge", ylabel="rise of the corner [mm]", xticks=ACROSS, ylim=(0, None)
    )
    middle.legend()
    for kind, values in result.constants.items():
        right.plot(ACROSS, values, "o-", color=COLOURS[kind], label=kind)
    right.set(xlabel="elements along an edge", ylabel="inf-sup constant", xticks=ACROSS, ylim=(-0.03, None))
    right.legend()


def page(result: Result) -> str:
    """The page."""
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
    return f"""# {TITLE}

**What is checked.** The elements of {{doc}}`../theory/equilibrium`, nearly incompressible ones above all.
Patch tests of every element, tangents and derivatives against differences, follower pressure and contact
against closed forms are quick tests in `tests/unit/equilibrium`.

## A thick cylinder under pressure

Plane strain, radii 1 and 2 m, neo-Hookean with K / mu = {NEARLY:.0e}, inner radius taken to 1.5 m by the
pressure of the incompressible closed form (axisymmetric, follower pressure, mixed). Relative error of the
inner radius with {ACROSS[0]}, {ACROSS[1]} and {ACROSS[2]} elements across:

| element | {" | ".join(map(str, ACROSS))} | fitted order | theory |
| --- | --- | --- | --- | --- | --- |
{cylinder}

The 8-node quadrilateral and the 6-node triangle are held back by their constant pressure.

## Cook's membrane

Simo and Armero (1992), Section 4.2: K / mu = 5000, finite strain, plane strain. Rise of the upper right
corner [mm]:

| element | {" | ".join(map(str, ACROSS))} |
| --- | --- | --- | --- |
{membrane}

DOLFINx 0.5.2 with the triangles of Taylor and Hood, another formulation with a continuous pressure, has
{peer} mm with {cells} cells along an edge, and their limit (Aitken's rule
on the last three) is {result.membrane_of_peer[0]:.3f} mm. On {FINE} x {FINE} elements {fine}
(`tests/reference/L_dolfinx.py`; {100 * TIP_HELD:.1f} % are held).

## Inf-sup constants

By the eigenvalue test of Chapelle and Bathe (1993) on a clamped unit square, uniform meshes of {ACROSS[0]},
{ACROSS[1]} and {ACROSS[2]} elements along an edge:

| element | {" | ".join(map(str, ACROSS))} |
| --- | --- | --- | --- |
{constants}

On a clamped cube of 27 elements: {solids}. The mean dilatation of the 4-node quadrilateral and the 8-node
hexahedron has a pressure in the pattern of a chessboard that no displacement sees: their displacements
converge, their pressures need not. The 10-node tetrahedron with a constant pressure fails too, and is
refused in a mixed model.

## Another program

Forces of a bonded strip, 6 × 3 × 1 27-node hexahedra at nu = 0.45, in five steps to 125 %: they differ from
those of FElupe by at most {result.peer:.0e}. `python -m benchmarks.equilibrium` compares any mesh and takes
the time of both.
"""
