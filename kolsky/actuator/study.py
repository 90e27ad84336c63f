"""What `kolsky actuator simulate` does: the bend in every direction of gravity, pristine and healed."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from kolsky.actuator.model import Bending
from kolsky.actuator.reading import ActuatorSpec
from kolsky.base.arrays import FloatArray

FILM_STEPS = 8
"""Least number of steps to the largest pressure."""


@dataclass(frozen=True)
class Direction:
    """The actuator under one direction of gravity."""

    name: str
    """Name of the direction in SPEC."""
    pristine: Bending
    """Equilibria under rising pressures."""
    healed: Bending | None
    """The same of the healed material."""
    asked: FloatArray
    """Steps of the declared pressures, shape [n_pressures]."""
    gap: FloatArray
    """Smallest distance of neighbouring chambers [m], shape [n]; below 0 they overlap. NaN without gaps."""


def simulate_all(spec: ActuatorSpec) -> list[Direction]:
    """Simulate every direction of gravity at the declared pressures and at steps between them.

    Raises
    ------
    ValueError
        If an equilibrium is not found, with its reason.
    """
    pressures, asked = schedule(spec.pressures)
    found = []
    for name, g in spec.gravities.items():
        runs = []
        for solid in (None, spec.healed):
            if solid is None and runs:
                runs.append(None)
                continue
            run = spec.actuator.simulate(g, pressures, solid=solid)
            outcome = run.solution.outcome
            if not outcome.ok:
                reached = 1e-5 * pressures[max(run.solution.reached - 1, 0)]
                raise ValueError(f"{name}, beyond {reached:.3g} bar: {outcome.cause}; {outcome.cure}")
            runs.append(run)
        assert runs[0] is not None
        found.append(Direction(name, runs[0], runs[1], asked, smallest_gap(runs[0])))
    return found


def schedule(pressures: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Steps from 0 to the largest pressure [Pa] that pass each of those given, and their places."""
    step = float(pressures[-1]) / FILM_STEPS
    ends = np.concatenate([[0.0], pressures[pressures > 0.0]])
    parts = [np.array([0.0])]
    for a, b in pairwise(ends):
        parts.append(np.linspace(a, b, max(1, int(np.ceil((b - a) / step - 1e-9))) + 1)[1:])
    steps = np.concatenate(parts)
    return steps, np.array([int(np.argmin(np.abs(steps - p))) for p in pressures])


def smallest_gap(run: Bending) -> FloatArray:
    """Smallest distance of the facing walls of neighbouring chambers [m], shape [n].

    Each pair of facing points is taken along the line between the middles of its two walls; negative where
    they have passed each other.
    """
    mesh, u = run.solution.model.mesh, run.solution.displacements
    smallest = np.full(len(u), np.nan)
    number = 1
    while f"gap_{number}_left" in mesh.sets:
        left, right = (
            mesh.points[mesh.sets[f"gap_{number}_{side}"]] + u[:, mesh.sets[f"gap_{number}_{side}"]]
            for side in ("left", "right")
        )
        across = (right - left).mean(axis=1)
        across = across / np.linalg.norm(across, axis=-1, keepdims=True)
        each = np.einsum("npd,nd->np", right - left, across).min(axis=1)
        smallest = np.fmin(smallest, each)
        number += 1
    return smallest


def warnings_of(directions: list[Direction]) -> list[str]:
    """What a reader must know before using the bends."""
    said = []
    for one in directions:
        through = np.flatnonzero(one.gap < 0.0)
        if through.size:
            pressure = 1e-5 * float(one.pristine.pressures[through[0]].max())
            said.append(
                f"{one.name}: from {pressure:.3g} bar on neighbouring chambers overlap, which they cannot: "
                "the bends beyond are not those of the actuator; widen the gap or end at a lower pressure"
            )
    return said


def relative_bend(one: Direction) -> FloatArray:
    """Bend of the healed actuator over that of the pristine one, both from rest, less 1, at the declared
    pressures [-], shape [n_pressures]."""
    assert one.healed is not None
    before, after = (run.angle - run.angle[0] for run in (one.pristine, one.healed))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray((after / before - 1.0)[one.asked])
