"""What `kolsky actuator simulate` does: the bend in every direction of gravity, pristine and healed."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from implicit.arc_length import ArcPath
from implicit.dynamics.march import march
from implicit.dynamics.relaxation import Prony
from implicit.laws.solid import Solid
from kolsky.actuator.gaps import Touching, smallest_gap, touching
from kolsky.actuator.model import WEIGHT, Bending, bend_of
from kolsky.actuator.reading import ActuatorSpec
from kolsky.base.arrays import BoolArray, FloatArray

OVERLAP = 0.1
"""Overlap of facing points with contact, as a share of the gap at rest, from which on it is named [-]."""
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
    path: ArcPath | None = None
    """Equilibria by arc length, where SPEC declares it."""
    touching: Touching | None = None
    """Their contact, where SPEC declares it."""

    @property
    def overlapping(self) -> BoolArray:
        """Steps at which chambers have passed through each other, shape [n]; the facing points by which gaps
        are measured may slide along walls in contact, so a tenth of the gap at rest is allowed there."""
        allowed = 0.0 if self.touching is None else OVERLAP * self.gap[0]
        with np.errstate(invalid="ignore"):
            return np.asarray(self.gap < -allowed)


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
        runs: list[Bending | None] = []
        paths: list[ArcPath | None] = []
        for solid in (None, spec.healed):
            if solid is None and runs:
                runs.append(None)
                continue
            run, path = _simulated(spec, g, pressures, solid)
            paths.append(path)
            outcome = run.solution.outcome
            if not outcome.ok:
                reached = 1e-5 * pressures[max(run.solution.reached - 1, 0)]
                raise ValueError(f"{name}, beyond {reached:.3g} bar: {outcome.cause}; {outcome.cure}")
            runs.append(run)
        assert runs[0] is not None
        gap, contact = smallest_gap(runs[0]), touching(runs[0])
        found.append(Direction(name, runs[0], runs[1], asked, gap, paths[0], contact))
    return found


def _simulated(
    spec: ActuatorSpec, gravity: FloatArray, pressures: FloatArray, solid: Solid | None
) -> tuple[Bending, ArcPath | None]:
    """Equilibria step by step, or along the path where SPEC declares one."""
    section = spec.declared.path
    if section is None:
        return spec.actuator.simulate(gravity, pressures, solid=solid), None
    return spec.actuator.follow(
        gravity,
        pressures,
        first=section.first,
        steps=section.steps,
        longest=section.longest,
        solid=solid,
    )


def path_angle(path: ArcPath) -> FloatArray:
    """Bending angle along a path [rad], shape [n]."""
    mesh = path.model.mesh
    ends = [
        (mesh.points[mesh.nodes(where)] + path.displacements[:, mesh.nodes(where)]).mean(axis=1)
        for where in ("origin", "tip")
    ]
    return bend_of(ends[1] - ends[0])


def schedule(pressures: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Steps from 0 to the largest pressure [Pa] that pass each of those given, and their places."""
    step = float(pressures[-1]) / FILM_STEPS
    ends = np.concatenate([[0.0], pressures[pressures > 0.0]])
    parts = [np.array([0.0])]
    for a, b in pairwise(ends):
        parts.append(np.linspace(a, b, max(1, int(np.ceil((b - a) / step - 1e-9))) + 1)[1:])
    steps = np.concatenate(parts)
    return steps, np.array([int(np.argmin(np.abs(steps - p))) for p in pressures])


@dataclass(frozen=True)
class BendInTime:
    """A motion of the actuator under one direction of gravity."""

    name: str
    """Name of the direction in SPEC."""
    time: FloatArray
    """Times [s], shape [n]."""
    pressure: FloatArray
    """Pressure [Pa], shape [n]."""
    angle: FloatArray
    """Bending angle [rad], shape [n]."""


def move(spec: ActuatorSpec, directions: list[Direction]) -> list[BendInTime]:
    """Raise the largest pressure in time, from rest under the weight, as [motion] declares.

    Raises
    ------
    ValueError
        If a step is not found, with its reason.
    """
    section = spec.declared.motion
    if section is None:
        return []
    prony = None
    if section.prony:
        prony = Prony(tuple(one.share for one in section.prony), tuple(one.time for one in section.prony))
    steps = round((section.ramp + section.hold) / section.step)
    time = np.asarray(section.step * np.arange(steps + 1), dtype=np.float64)
    pressure = spec.pressures[-1] * np.minimum(time / section.ramp, 1.0)
    found = []
    for one in directions:
        model = one.pristine.solution.model
        histories = {WEIGHT: np.ones(steps), **{h: pressure[1:] for h in spec.actuator.histories}}
        run = march(
            model,
            histories,
            section.step,
            density=spec.actuator.density,
            scheme=section.scheme,
            prony=prony,
            start=one.pristine.solution.displacements[0],
            start_histories={WEIGHT: 1.0, **dict.fromkeys(spec.actuator.histories, 0.0)},
        )
        if not run.outcome.ok:
            reached = time[run.reached - 1]
            raise ValueError(f"{one.name}, beyond {reached:.4g} s: {run.outcome.cause}; {run.outcome.cure}")
        mesh = model.mesh
        ends = [
            mesh.points[mesh.nodes(where)].mean(axis=0) + run.mean_displacement(where)
            for where in ("origin", "tip")
        ]
        found.append(BendInTime(one.name, time, pressure, bend_of(ends[1] - ends[0])))
    return found


def warnings_of(directions: list[Direction]) -> list[str]:
    """What a reader must know before using the bends."""
    said = []
    for one in directions:
        limits = np.array([]) if one.path is None else one.path.limits
        if limits.size:
            said.append(
                f"{one.name}: the pressure has a limit point at {1e-5 * limits[0]:.3g} bar: the actuator "
                "snaps there, and its bend jumps"
            )
        through = np.flatnonzero(one.overlapping)
        if through.size:
            pressure = 1e-5 * float(one.pristine.pressures[through[0]].max())
            said.append(
                f"{one.name}: from {pressure:.3g} bar on neighbouring chambers overlap, which they cannot: "
                "the bends beyond are not those of the actuator; "
                + ("declare [contact]" if one.touching is None else "take more steps or a finer mesh")
            )
    return said


def relative_bend(one: Direction) -> FloatArray:
    """Bend of the healed actuator over that of the pristine one, both from rest, less 1, at the declared
    pressures [-], shape [n_pressures]."""
    assert one.healed is not None
    before, after = (run.angle - run.angle[0] for run in (one.pristine, one.healed))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray((after / before - 1.0)[one.asked])
