"""A shot's simulations with what is beside its specimen: elastic parts, and transducers where they sit.

The parts behind the specimen and the flyer's are linear (`explicit.bars.pulse`). Specimen and parts run in
turn, each under what the other did before, until the forces stay (waveform iteration, as in
`explicit.bars.coupling`, for whole batches): the specimen gives the forces on both platens, the parts give
the support's motion and what lies between the flyer's face and the place the cameras see.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np
from scipy.interpolate import CubicSpline

import explicit
from explicit.bars import PulseResponse, Section, pulse_on_bars, pulse_on_mesh
from explicit.support import MovingSupport
from kolsky.base.apparatus import ElasticBody
from kolsky.base.arrays import FloatArray
from kolsky.inverse.transducer_place import at_transducer
from kolsky.shot.records import ShotBase

AGREED = 1e-3
"""Root mean square change of the forces from a pass to the next over that of the forces, at which specimen
and parts agree [-]."""
MOST_PASSES = 8
"""Passes after which it is given up."""

Run = Callable[[Sequence[explicit.Problem]], list[explicit.Response]]


def in_surroundings(
    shots: Sequence[ShotBase], problems: Sequence[explicit.Problem], run: Run
) -> list[explicit.Response]:
    """Run batches, one a shot, each in its shot's surroundings, the forces as its transducers have them.

    Parameters
    ----------
    shots, problems
        The shots and their batches.
    run
        What runs batches.

    Raises
    ------
    ValueError
        If a specimen and its elastic parts do not agree in `MOST_PASSES` passes.
    """
    found = run(problems)
    left = [k for k, shot in enumerate(shots) if shot.behind is not None or shot.flyer_body is not None]
    for _ in range(MOST_PASSES):
        if not left:
            break
        again = run([with_moved_faces(shots[k], problems[k], found[k]) for k in left])
        apart = [_apart(found[k], new) for k, new in zip(left, again, strict=True)]
        for k, new in zip(left, again, strict=True):
            found[k] = new
        left = [k for k, change in zip(left, apart, strict=True) if change > AGREED]
    if left:
        raise ValueError(
            f"specimen and elastic parts do not agree after {MOST_PASSES} passes (forces change by "
            f'{max(apart):.2g} of their size): declare stiffer parts, or support = "bar"'
        )
    return [as_recorded(*each) for each in zip(shots, problems, found, strict=True)]


def with_moved_faces(
    shot: ShotBase, problem: explicit.Problem, response: explicit.Response
) -> explicit.Problem:
    """A batch whose platens move as the shot's elastic parts do under the forces of its last pass."""
    model, samples = problem.model, problem.samples
    times = _knots(model)
    if shot.behind is not None:
        parts = _pulse(shot, shot.behind, times)
        paths = -parts.histories(_at(response.impulse_transmission, response, times), "path")
        model = replace(model, support=MovingSupport(tuple(_motion(times, row) for row in paths)))
    if shot.flyer_body is not None:
        parts = _pulse(shot, shot.flyer_body, times)
        impulse = _at(response.impulse_flyer, response, times)
        # The face is nearer to the specimen than the measured place has gone, by what lies between gives way.
        short = parts.histories(impulse, "path") - parts.histories(impulse, "seen")
        short -= short[:, :1]  # the round-off of the convolution at rest
        measured = problem.model.motions
        motions = tuple(
            explicit.PlatenMotion(
                start=measured[m].start,
                step=measured[m].step,
                position=measured[m].position - row,
                velocity=measured[m].velocity - CubicSpline(times, row)(times, 1),
            )
            for m, row in zip(samples.motion, short, strict=True)
        )
        model = replace(model, motions=motions)
        samples = replace(samples, motion=np.arange(len(samples)))
    return replace(problem, model=model, samples=samples)


def as_recorded(shot: ShotBase, problem: explicit.Problem, response: explicit.Response) -> explicit.Response:
    """A batch with the forces at the transducers in place of those on the platens' faces.

    Parameters
    ----------
    shot
        The shot. The flyer's force is left on the face where the shot has none to compare it with.
    problem
        The batch, its flyer moving as measured.
    response
        Its simulations from rest on.
    """
    times = _knots(problem.model)
    if shot.behind is None:
        response = at_transducer(shot, response)
    elif shot.behind.transducer_depth > 0.0:
        force = _pulse(shot, shot.behind, times).histories(
            _at(response.impulse_transmission, response, times), "section"
        )
        force, impulse = _recorded(times, force, response, response.force_transmission)
        response = replace(response, force_transmission=force, impulse_transmission=impulse)
    if shot.incident is None:
        return response
    speeds = {m: CubicSpline(times, problem.model.motions[m].velocity) for m in _used(problem)}
    since = response.force_times
    gained = np.array([speeds[m](since) for m in problem.samples.motion.tolist()])
    push = np.array([speeds[m](since, 1) for m in problem.samples.motion.tolist()])
    force, impulse, mass = response.force_flyer, response.impulse_flyer, shot.incident.mass
    body = shot.flyer_body
    if body is not None:
        if body.transducer_depth == 0.0:
            return response
        # What pushes the flyer from behind moves it as one: that part is its measured motion less the
        # specimen's share in it.
        mass, share = mass_before(body), 1.0 / mass_before(body, body.length)
        push, gained = push + share * force, gained + share * impulse
        waves = _pulse(shot, body, times).histories(_at(impulse, response, times), "section")
        force, impulse = _recorded(times, waves, response, force)
    # m a = F_transducer - F_specimen, of the mass before the sensing plane.
    return replace(response, force_flyer=force + mass * push, impulse_flyer=impulse + mass * gained)


def mass_before(body: ElasticBody, depth: float | None = None) -> float:
    """Mass of the parts between the face and a section, that of the transducer if left out [kg]."""
    rest, mass = body.transducer_depth if depth is None else depth, 0.0
    for part in body.parts:
        mass += part.density * 0.25 * np.pi * part.diameter**2 * min(part.length, max(rest, 0.0))
        rest -= part.length
    return mass


def _used(problem: explicit.Problem) -> set[int]:
    return set(problem.samples.motion.tolist())


def _apart(before: explicit.Response, now: explicit.Response) -> float:
    """Root mean square change of the forces over their own; of runs that were lost, until they were."""
    pairs = (
        (before.force_transmission, now.force_transmission),
        (before.force_flyer, now.force_flyer),
    )
    changes = []
    for a, b in pairs:
        both = np.isfinite(a) & np.isfinite(b)
        size = float((b[both] ** 2).sum())
        changes.append(np.sqrt(float(((b - a)[both] ** 2).sum()) / size) if size > 0.0 else 0.0)
    return max(changes)


def _knots(model: explicit.Model) -> FloatArray:
    motion = model.motions[0]
    return motion.start + motion.step * np.arange(len(motion.position), dtype=np.float64)


def _at(impulse: FloatArray, response: explicit.Response, times: FloatArray) -> FloatArray:
    """Impulses at other times [N s], from rest on; NaN after a run was lost."""
    return np.stack([np.interp(times, response.force_times, row, left=0.0) for row in impulse])


def _recorded(
    times: FloatArray, force: FloatArray, response: explicit.Response, known: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Force and impulse at the response's times from the force at others; NaN where a run was lost."""
    step = np.diff(times)
    summed = np.cumsum(0.5 * step * (force[:, 1:] + force[:, :-1]), axis=1)
    impulse = np.concatenate([np.zeros((len(force), 1)), summed], axis=1)
    lost = ~np.isfinite(known)
    found = []
    for rows in (force, impulse):
        seen = np.stack([np.interp(response.force_times, times, row) for row in rows])
        found.append(np.where(lost, np.nan, seen))
    return found[0], found[1]


def _motion(times: FloatArray, position: FloatArray) -> explicit.PlatenMotion:
    return explicit.PlatenMotion(
        start=float(times[0]),
        step=float(times[1] - times[0]),
        position=position - position[0],
        velocity=CubicSpline(times, position)(times, 1),
    )


def _pulse(shot: ShotBase, body: ElasticBody, times: FloatArray) -> PulseResponse:
    step = round(float(times[-1] - times[0]) / (len(times) - 1), 15)
    return _made(body, shot.specimen.radius, step, len(times))


@lru_cache(maxsize=16)
def _made(body: ElasticBody, radius: float, step: float, n: int) -> PulseResponse:
    """The parts' response to a pulse that presses within the specimen's radius, or on the whole face."""
    sections = tuple(
        Section(part.length, 0.5 * part.diameter, part.youngs_modulus, part.density, part.poisson)
        for part in body.parts
    )
    places = {"sensor": body.transducer_depth, "seen": body.seen_at}
    if body.model == "bar":
        return pulse_on_bars(sections, step=step, n=n, **places)
    pressed = min(radius, sections[0].radius)
    return pulse_on_mesh(sections, step=step, n=n, size=body.element_size, radius=pressed, **places)
