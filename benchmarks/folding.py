"""Where the edge of a sliding specimen folds over: impacts with both elements, and what the caution says.

    python -m benchmarks.folding            # the impacts that the threshold was chosen on
    python -m benchmarks.folding --judge    # others, made afterwards

Impacts at 2.6 m/s to 56 % on the specimen of the verification manual. A row an impact: the last radius of
the edge, from 24 % on its largest jump between two of the times beyond the median, and its distance from the
F-bar element's on the same mesh, the smallest corner, and whether the warning is raised.
"""

import argparse
from dataclasses import dataclass

import numpy as np

from explicit import Model, PlatenMotion, Samples, Sampling, cylinder, run
from explicit.folding import corner_areas
from explicit.materials import neo_hookean
from kolsky.base.arrays import FloatArray
from kolsky.uncertainty.warnings.runs import FOLDED

RADIUS, LENGTH, DENSITY, SHEAR = 4.75e-3, 6.5e-3, 870.0, 80e3 / (2.0 * 1.495)
"""Specimen [m], [kg/m^3] and shear modulus [Pa] of the verification manual: E = 80 kPa, nu = 0.495."""
SPEED, RISE, END, DAMPING, POISSON = 2.6, 50e-6, 1.4e-3, 2.5e-5, 0.495
CHOSEN = (((24, 33, 1.0), (24, 33, 3.0), (48, 66, 1.0)), (0.1, 0.3, 0.5))
JUDGED = (((24, 33, 2.0), (40, 55, 1.5), (56, 76, 1.0)), (0.15, 0.25, 0.35, 0.45))
"""Meshes (elements across and along, largest over smallest) and coefficients of friction."""
JUMP = 50e-6
"""Jump of the edge from one time to the next, 0.1 ms later, that is to be caught [m]."""
FROM = 5
"""First of the times whose edge is looked at: before it the face still slips as it should."""


@dataclass(frozen=True)
class Impact:
    """One impact."""

    friction: float
    """Coefficient [-]."""
    edge: FloatArray
    """Radius of the edge at each time, mean of both faces [m], shape [n_times]."""
    corner: float
    """Smallest area at a corner over the undeformed one [-]."""

    @property
    def jump(self) -> float:
        """Largest motion of the edge between two times beyond what is usual for it, the median [m]."""
        steps = np.abs(np.diff(self.edge))[FROM:]
        return float(steps.max() - np.median(steps))

    @property
    def said(self) -> bool:
        """Whether the warning is raised."""
        return self.corner < FOLDED


def impacts(mesh: tuple[int, int, float], element: str, friction: tuple[float, ...]) -> list[Impact]:
    """Impacts on one mesh, one a coefficient."""
    body = cylinder(RADIUS, LENGTH, n_radial=mesh[0], n_axial=mesh[1], grading=mesh[2])
    motion = PlatenMotion.sampled(
        lambda t: SPEED * np.where(t < RISE, 0.5 * t**2 / RISE, t - 0.5 * RISE),
        lambda t: SPEED * np.minimum(t / RISE, 1.0),
        start=0.0,
        end=END,
    )
    law = (neo_hookean(SHEAR),)
    model = Model(body, DENSITY, law, (motion,), faces="coulomb", side="coulomb", element=element)
    times = np.linspace(0.0, END, 15)[1:]
    samples = Samples.of(poisson=POISSON, damping=DAMPING, friction=np.array(friction))
    done = run(model, samples, Sampling(times, times, all_nodes=True))
    assert done.nodes is not None
    edges = 0.5 * (done.surface_r[:, :, 0] + done.surface_r[:, :, -1])
    corners = [float(corner_areas(body, nodes).min()) for nodes in done.nodes]
    return [Impact(*row) for row in zip(friction, edges, corners, strict=True)]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--judge", action="store_true", help="impacts that the threshold was not chosen on")
    meshes, friction = JUDGED if parser.parse_args().judge else CHOSEN
    print(
        "| mesh | element | f | edge, last [mm] | jump [um] | from F-bar [um] | smallest corner | warned of |"
    )
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    every: list[Impact] = []
    for mesh in meshes:
        whole = impacts(mesh, "fbar", friction)
        for element, rows in (("fbar", whole), ("one_point", impacts(mesh, "one_point", friction))):
            for row, reference in zip(rows, whole, strict=True):
                away = float(np.abs(row.edge - reference.edge)[FROM:].max())
                said = "yes" if row.said else "no"
                cells = f"{row.friction} | {1e3 * row.edge[-1]:.3f} | {1e6 * row.jump:.0f} | {1e6 * away:.0f}"
                name = f"{mesh[0]} x {mesh[1]}, {mesh[2]:g} | {element}"
                print(f"| {name} | {cells} | {row.corner:.2f} | {said} |", flush=True)
            every += rows
    caught = sum(row.jump > JUMP and row.said for row in every)
    missed = sum(row.jump > JUMP and not row.said for row in every)
    idle = sum(row.jump <= JUMP and row.said for row in every)
    print(f"\njumps of the edge caught: {caught}, missed: {missed}; warned of without a jump: {idle}")


if __name__ == "__main__":
    main()
