"""The true behaviour of a synthetic shot, without instruments."""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import cumulative_trapezoid

import explicit
from kolsky.base.apparatus import SLIDING_LAW, Bar
from kolsky.base.arrays import FloatArray
from kolsky.virtual.material import law_of
from kolsky.virtual.motion import Path1D, path_of
from kolsky.virtual.schema import Specification


@dataclass(frozen=True)
class SurfaceHistory:
    """Specimen and flyer at the true times of the frames, including static ones."""

    time: FloatArray
    """Times on the shot's clock [s], shape [n_frames]."""
    r: FloatArray
    """Radius of the side surface's nodes, transmission platen first [m], shape [n_frames, n_nodes]."""
    y: FloatArray
    """Height of these nodes above the transmission platen's initial plane [m], shape [n_frames, n_nodes]."""
    displacement: FloatArray
    """Displacement of the flyer's centre toward the specimen [m], shape [n_frames]."""
    tilt: FloatArray
    """Pitch of the flyer in the cameras' plane, with the camera side ahead [rad], shape [n_frames]."""


@dataclass(frozen=True)
class Truth:
    """The true behaviour of a synthetic shot."""

    surface: SurfaceHistory
    force_time: FloatArray
    """Times on the shot's clock, uniform [s], shape [n]."""
    transmitted: FloatArray
    """Force of the specimen on the transmission platen, compression-positive [N], shape [n]."""
    incident: FloatArray
    """Force of the flyer's platen on the specimen [N], shape [n]."""
    flyer_acceleration: FloatArray
    """Acceleration of the flyer toward the specimen [m/s^2], shape [n]."""
    support_acceleration: FloatArray
    """Acceleration of the transmission platen away from the specimen [m/s^2], shape [n]."""
    flyer_radius: float
    """Radius of the flyer's side visible to the cameras [m]."""


class TruthError(Exception):
    """A simulation of a truth did not reach its end. The message gives the reason."""


MARGIN = 15e-6
"""Simulated time after the end of the record, and recorded time after the last frame [s]."""


@dataclass(frozen=True)
class Job:
    """One shot's simulation, timed from the flyer's start."""

    quantities: Specification
    path: Path1D
    end: float
    """Time from start to end of the record [s]."""
    frames: FloatArray
    """True times of the frames after the start [s], shape [n_frames]. Those of static frames are 0 or
    negative."""

    @property
    def last(self) -> float:
        """Simulated time from the start [s]."""
        late = abs(self.quantities.imperfections.trigger) + abs(self.quantities.transmitted.delay)
        return self.end + MARGIN + late

    @classmethod
    def of(cls, quantities: Specification, folder: Path = Path()) -> "Job":
        """The simulation of a specification.

        Its other files are in `folder`.

        Raises ValueError if its motion is not possible.
        """
        path, end = path_of(quantities, folder)
        frames = quantities.frames
        first = -(frames.static - 1 + frames.phase) / frames.rate
        count = int(np.floor((end - first) * frames.rate * (1.0 + 1e-12))) + 1
        return cls(quantities, path, end, first + np.arange(count) / frames.rate)

    @property
    def contact(self) -> tuple[str, str]:
        """True contact laws of faces and side."""
        slips = self.quantities.imperfections.slip_friction > 0.0
        declared = self.quantities.interface
        return (SLIDING_LAW, SLIDING_LAW) if slips else (declared.faces, declared.side)

    @property
    def group(self) -> Hashable:
        """Key of the solver model. Shots with the same key are simulated together."""
        q = self.quantities
        kind = "prony" if q.relaxation is None else q.relaxation.kind
        relaxing = kind, sum(len(one) for one in q.relaxing)
        support = q.transmission.model_dump_json()
        return (q.specimen, q.truth, q.material.law, relaxing, self.contact, support)


MIDDLE = ("fbar", "one_point")
"""Elements averaged by `element = "middle"`."""


def _elements_of(quantities: Specification) -> list[Specification]:
    """One specification for each element used to simulate its truth."""
    truth = quantities.truth
    if truth.element != "middle":
        return [quantities]
    return [
        quantities.model_copy(update={"truth": truth.model_copy(update={"element": element})})
        for element in MIDDLE
    ]


def middle(truths: Sequence[Truth | TruthError]) -> Truth | TruthError:
    """The mean of the truths of one shot.

    If any simulation failed, the first failure.

    ``truths``: one per element, at the same times.
    """
    found = []
    for truth in truths:
        if isinstance(truth, TruthError):
            return truth
        found.append(truth)

    def means(each: Sequence[object], *names: str) -> dict[str, Any]:
        return {name: np.mean([getattr(one, name) for one in each], axis=0) for name in names}

    surfaces = [truth.surface for truth in found]
    surface = replace(surfaces[0], **means(surfaces, "r", "y", "tilt"))
    return replace(
        found[0], surface=surface, **means(found, "transmitted", "incident", "support_acceleration")
    )


KNOT = 2.5e-7
"""Distance of the knots of the platen's motion, and of the samples of the force [s]."""


def simulate_truths(
    specifications: Sequence[Specification],
    *,
    folder: Path = Path(),
    device: str = "cpu",
    threads: int | None = None,
) -> list[Truth]:
    """Simulate the truths of several shots. All of them must reach their end.

    ``specifications``, ``folder``, ``device``, ``threads``: as in `try_truths`. Raises TruthError if a
    simulation did not reach its end. Raises ValueError if a specification cannot be simulated.
    """
    truths = []
    for found in try_truths(specifications, folder=folder, device=device, threads=threads):
        if isinstance(found, TruthError):
            raise found
        truths.append(found)
    return truths


def try_truths(
    specifications: Sequence[Specification],
    *,
    folder: Path = Path(),
    device: str = "cpu",
    threads: int | None = None,
) -> list[Truth | TruthError]:
    """Simulate the truths of several shots. A failed simulation does not affect the others. Shots with one
    mesh and one kind of material form one launch. On a GPU, the launches run in parallel. Shots of forty
    geometries therefore take little longer than one. Each result is bit-identical to a separate run."""
    elements = [_elements_of(quantities) for quantities in specifications]
    each = iter(_try_each([one for both in elements for one in both], folder, device, threads))
    return [middle([next(each) for _ in both]) for both in elements]


def _try_each(
    specifications: Sequence[Specification], folder: Path, device: str, threads: int | None
) -> list[Truth | TruthError]:
    """The truths of specifications that name one element each."""
    all_jobs = [Job.of(quantities, folder) for quantities in specifications]
    groups: dict[Hashable, list[int]] = {}
    for number, job in enumerate(all_jobs):
        groups.setdefault(job.group, []).append(number)
    members = list(groups.values())
    batches = [[all_jobs[number] for number in numbers] for numbers in members]
    responses = _run([(batch, [np.zeros(0)] * len(batch)) for batch in batches], device, threads)
    tilts = [
        [_tilt(job, response, row) for row, job in enumerate(batch)]
        for batch, response in zip(batches, responses, strict=True)
    ]
    # If a flyer tilts, the cameras record a separate run.
    tilted = [i for i, group in enumerate(tilts) if any(np.any(tilt) for tilt in group)]
    shifts = [
        [
            tilt * 0.5 * job.quantities.specimen.diameter
            for job, tilt in zip(batches[i], tilts[i], strict=True)
        ]
        for i in tilted
    ]
    again = _run([(batches[i], shift) for i, shift in zip(tilted, shifts, strict=True)], device, threads)
    seen = dict(zip(tilted, again, strict=True))
    truths: dict[int, Truth | TruthError] = {}
    for i, (batch, response) in enumerate(zip(batches, responses, strict=True)):
        for row, (job, tilt) in enumerate(zip(batch, tilts[i], strict=True)):
            looked_at = seen.get(i, response)
            failed = _failure(job, response, row) or _failure(job, looked_at, row)
            truths[members[i][row]] = failed or _truth(job, response, looked_at, row, tilt)
    return [truths[number] for number in range(len(all_jobs))]


def _failure(job: Job, response: explicit.Response, row: int) -> TruthError | None:
    """The failure of a simulation. None if it reached its end."""
    if response.end_times[row] >= job.last * (1.0 - 1e-9):
        return None
    return TruthError(
        f"{job.quantities.name}: the simulation ended {response.describe(row)}: use a smaller compression "
        "or a finer mesh"
    )


def _run(
    batches: Sequence[tuple[Sequence[Job], Sequence[FloatArray]]], device: str, threads: int | None
) -> list[explicit.Response]:
    """Simulate batches of jobs, one model per batch. Each job has an added flyer displacement [m]."""
    problems = [_problem(jobs, shift) for jobs, shift in batches]
    return explicit.run_side_by_side(problems, device=device, threads=threads)


def _problem(jobs: Sequence[Job], shift: Sequence[FloatArray]) -> explicit.Problem:
    """The batch of jobs of one model. `shift` is added at the times of the force [m]."""
    first, bar = jobs[0].quantities, _bar(jobs[0].quantities)
    last = max(job.last for job in jobs)
    times = KNOT * np.arange(int(np.ceil(last / KNOT)) + 1, dtype=np.float64)
    surface = np.unique(np.concatenate([job.frames[job.frames > 0.0] for job in jobs]))
    material = [job.quantities.material for job in jobs]
    relaxation = tuple(one for job in jobs for one in job.quantities.relaxing)
    model = explicit.Model(
        mesh=_mesh(first),
        density=first.specimen.density,
        materials=tuple(law_of(m.law, m.parameters, m.shear_modulus) for m in material),
        motions=tuple(_motion(job, add, times) for job, add in zip(jobs, shift, strict=True)),
        faces=jobs[0].contact[0],
        side=jobs[0].contact[1],
        support=explicit.RIGID if bar is None else explicit.CharacteristicBar(bar.impedance, bar.round_trip),
        element=first.truth.element,
        relaxation=relaxation,
    )
    index = np.arange(len(jobs))
    samples = explicit.Samples.of(
        stiffness_factor=np.array([m.stiffness_factor for m in material]),
        poisson=np.array([m.poisson for m in material]),
        damping=np.array([m.damping for m in material]),
        mass_damping=np.array([m.mass_damping for m in material]),
        friction=np.array([_friction(job.quantities) for job in jobs]),
        material=index,
        motion=index,
        relaxation=index if relaxation else 0,
    )
    sampling = explicit.Sampling(force_times=times, surface_times=surface, ledger_every=len(surface))
    return explicit.Problem(model, samples, sampling)


def _mesh(quantities: Specification) -> explicit.Mesh:
    specimen, truth = quantities.specimen, quantities.truth
    return explicit.cylinder(
        0.5 * specimen.diameter,
        specimen.length,
        n_radial=truth.mesh[0],
        n_axial=truth.mesh[1],
        grading=truth.grading,
    )


def _motion(job: Job, add: FloatArray, times: FloatArray) -> explicit.PlatenMotion:
    """The flyer's motion over the group's time. It is constant after the end of its job."""
    inside = times <= job.last
    held = np.minimum(times, job.last) + job.path.start
    position = job.path.displacement(held)
    velocity = np.where(inside, job.path.velocity(held), 0.0)
    if add.size:
        position = position + np.where(inside, add, add[inside][-1])
        velocity = velocity + np.where(inside, np.gradient(add, KNOT), 0.0)
    return explicit.PlatenMotion(start=0.0, step=KNOT, position=position - position[0], velocity=velocity)


def _bar(quantities: Specification) -> Bar | None:
    """The bar behind the transmission platen; None for a rigid one."""
    declared = quantities.transmission.bar
    return None if declared is None else Bar(**declared.model_dump())


def _friction(quantities: Specification) -> float:
    slip = quantities.imperfections.slip_friction
    return slip if slip > 0.0 else quantities.interface.friction


def _tilt(job: Job, response: explicit.Response, row: int) -> FloatArray:
    """Pitch of the flyer at the times of the force [rad], Eqs. (E.3) and (E.4), shape [n_times]."""
    q, times = job.quantities, response.force_times
    reached = job.path.displacement(np.minimum(times, job.last) + job.path.start)
    total = float(job.path.displacement(np.array([job.end + job.path.start]))[0])
    pitch = q.imperfections.tilt * reached / total
    if q.imperfections.off_centre != 0.0:
        radius, length = 0.5 * q.motion.flyer_diameter, q.motion.flyer_length
        inertia = q.motion.flyer_mass * (3.0 * radius**2 + length**2) / 12.0
        moment = np.nan_to_num(response.force_flyer[row]) * q.imperfections.off_centre
        rate = cumulative_trapezoid(moment / inertia, times, initial=0.0)
        pitch = pitch - cumulative_trapezoid(rate, times, initial=0.0)
    return np.asarray(pitch)


def _truth(
    job: Job, response: explicit.Response, seen: explicit.Response, row: int, tilt: FloatArray
) -> Truth:
    """The truth of one shot on the shot's clock."""
    q, start = job.quantities, job.path.start
    inside = response.force_times <= job.last * (1.0 + 1e-12)
    times = response.force_times[inside]
    moving = job.frames > 0.0
    rows = np.searchsorted(seen.surface_times, job.frames[moving])
    mesh = _mesh(q)
    rest = np.broadcast_to(mesh.nodes[mesh.side], (int((~moving).sum()), len(mesh.side), 2))
    surface = SurfaceHistory(
        time=job.frames + start,
        r=np.concatenate([rest[..., 0], seen.surface_r[row, rows]]),
        y=np.concatenate([rest[..., 1], seen.surface_y[row, rows]]),
        displacement=job.path.displacement(job.frames + start),
        tilt=np.interp(job.frames, response.force_times, tilt),
    )
    transmitted = response.force_transmission[row, inside]
    bar = _bar(q)
    support = np.zeros(len(times)) if bar is None else np.gradient(transmitted, KNOT) / bar.impedance
    return Truth(
        surface=surface,
        force_time=times + start,
        transmitted=transmitted,
        incident=response.force_flyer[row, inside],
        flyer_acceleration=np.gradient(job.path.velocity(times + start), KNOT),
        support_acceleration=support,
        flyer_radius=0.5 * q.motion.flyer_diameter,
    )
