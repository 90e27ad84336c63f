"""Folding of the edge of a sliding specimen: impacts with both elements, and whether the warning is raised.

    python -m populations.folding            # the impacts that the threshold was chosen on
    python -m populations.folding --judge    # others, made afterwards
    python -m populations.folding --drawn 8 --seed 4711   # drawn meshes, gradings, speeds and coefficients

The study makes impacts to 56 % compression on the specimen of the verification manual, at 2.6 m/s or a random
speed. Each impact has one row. It gives the final radius of the edge, and the largest jump of the edge
between two times from 24 % on, relative to the median. It also gives the distance from the radius with the
F-bar element on the same mesh, the smallest corner, and whether the warning is raised.
"""

import argparse
from dataclasses import dataclass

import numpy as np

from explicit import Model, PlatenMotion, Samples, Sampling, cylinder, run
from explicit.materials import neo_hookean
from explicit.mesh import corner_areas
from kolsky.base.arrays import FloatArray
from kolsky.uncertainty.warnings import FOLDED

RADIUS, LENGTH, DENSITY, SHEAR = 4.75e-3, 6.5e-3, 870.0, 80e3 / (2.0 * 1.495)
"""Specimen [m], [kg/m^3] and shear modulus [Pa] of the verification manual: E = 80 kPa, nu = 0.495."""
SPEED, RISE, END, DAMPING, POISSON = 2.6, 50e-6, 1.4e-3, 2.5e-5, 0.495
CHOSEN = (((24, 33, 1.0), (24, 33, 3.0), (48, 66, 1.0)), (0.1, 0.3, 0.5))
JUDGED = (((24, 33, 2.0), (40, 55, 1.5), (56, 76, 1.0)), (0.15, 0.25, 0.35, 0.45))
"""Meshes (elements across and along, largest over smallest) and coefficients of friction."""
ACROSS, GRADINGS, SPEEDS, COEFFICIENTS = (20, 44), (1.0, 3.0), (1.5, 3.5), (0.08, 0.6)
"""Ranges of random impacts: elements across, gradings, speeds [m/s], and four friction coefficients per
setting."""
JUMP = 50e-6
"""Jump of the edge between two successive times, 4 % of compression apart, that must be detected [m]."""
FROM = 5
"""Index of the first time at which the edge is checked. Before this time the face slips physically."""


@dataclass(frozen=True)
class Impact:
    """One impact."""

    friction: float
    """Coefficient [-]."""
    edge: FloatArray
    """Radius of the edge at each time, mean of both faces [m], shape [n_times]."""
    corner: float
    """Smallest corner area over its undeformed value [-]."""

    @property
    def jump(self) -> float:
        """Largest motion of the edge between two times minus the median motion [m]."""
        steps = np.abs(np.diff(self.edge))[FROM:]
        return float(steps.max() - np.median(steps))

    @property
    def said(self) -> bool:
        """Whether the warning is raised."""
        return self.corner < FOLDED


@dataclass(frozen=True)
class Setting:
    """Impacts with one mesh and one speed."""

    mesh: tuple[int, int, float]
    """Elements across and along, largest over smallest."""
    friction: tuple[float, ...]
    """Coefficients [-]."""
    speed: float = SPEED
    """Speed of the flyer [m/s]."""


def drawn(seed: int, count: int) -> list[Setting]:
    """Random settings from a seed."""
    rng = np.random.default_rng(seed)
    found = []
    for _ in range(count):
        across = int(rng.integers(ACROSS[0], ACROSS[1] + 1))
        along = round(across * LENGTH / RADIUS)
        mesh = (across, along, round(float(rng.uniform(*GRADINGS)), 1))
        low, high = np.log(COEFFICIENTS).tolist()
        friction = np.sort(np.exp(rng.uniform(low, high, 4)))
        found.append(
            Setting(mesh, tuple(np.round(friction, 2).tolist()), round(float(rng.uniform(*SPEEDS)), 1))
        )
    return found


def impacts(
    mesh: tuple[int, int, float], element: str, friction: tuple[float, ...], speed: float = SPEED
) -> list[Impact]:
    """Impacts on one mesh, one for each coefficient."""
    body = cylinder(RADIUS, LENGTH, n_radial=mesh[0], n_axial=mesh[1], grading=mesh[2])
    end = END * SPEED / speed
    motion = PlatenMotion.sampled(
        lambda t: speed * np.where(t < RISE, 0.5 * t**2 / RISE, t - 0.5 * RISE),
        lambda t: speed * np.minimum(t / RISE, 1.0),
        start=0.0,
        end=end,
    )
    law = (neo_hookean(SHEAR),)
    model = Model(body, DENSITY, law, (motion,), faces="coulomb", side="coulomb", element=element)
    times = np.linspace(0.0, end, 15)[1:]
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
    parser.add_argument("--drawn", type=int, help="settings that are drawn, four impacts with each element")
    parser.add_argument("--seed", type=int, default=1, help="of the drawn ones")
    given = parser.parse_args()
    meshes, friction = JUDGED if given.judge else CHOSEN
    settings = [Setting(mesh, friction) for mesh in meshes]
    if given.drawn:
        settings = drawn(given.seed, given.drawn)
    measured = "edge, last [mm] | jump [um] | from F-bar [um] | smallest corner | warning"
    print(f"| mesh, speed | element | f | {measured} |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    every: list[Impact] = []
    for one in settings:
        mesh = one.mesh
        whole = impacts(mesh, "fbar", one.friction, one.speed)
        point = impacts(mesh, "one_point", one.friction, one.speed)
        for element, rows in (("fbar", whole), ("one_point", point)):
            for row, reference in zip(rows, whole, strict=True):
                away = float(np.abs(row.edge - reference.edge)[FROM:].max())
                said = "yes" if row.said else "no"
                cells = f"{row.friction} | {1e3 * row.edge[-1]:.3f} | {1e6 * row.jump:.0f} | {1e6 * away:.0f}"
                name = f"{mesh[0]} x {mesh[1]}, {mesh[2]:g}; {one.speed:g} m/s | {element}"
                print(f"| {name} | {cells} | {row.corner:.2f} | {said} |", flush=True)
            every += rows
    caught = sum(row.jump > JUMP and row.said for row in every)
    missed = sum(row.jump > JUMP and not row.said for row in every)
    idle = sum(row.jump <= JUMP and row.said for row in every)
    print(f"\nJumps of the edge detected: {caught}, missed: {missed}; warnings without a jump: {idle}.")


if __name__ == "__main__":
    main()
