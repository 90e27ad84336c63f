"""The truth of made shots: runs of the solver, those on one mesh in one launch, and a flyer that tilts."""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.integrate import cumulative_trapezoid

import explicit
from kolsky.base.apparatus import SLIDING_LAW, Bar
from kolsky.base.arrays import FloatArray
from kolsky.virtual.material import law_of, relaxation_of
from kolsky.virtual.motion import Path1D, path_of
from kolsky.virtual.records import SurfaceHistory, Truth
from kolsky.virtual.schema import Specification

MARGIN = 15e-6
"""Time that is simulated beyond the record, and of the record beyond the last frame [s]."""
KNOT = 2.5e-7
"""Distance of the knots of the platen's motion, and of the force's samples [s]."""


class TruthError(Exception):
    """A simulation of a truth that did not reach its end; the message says why."""


@dataclass(frozen=True)
class Job:
    """One shot's simulation, timed from the flyer's start."""

    quantities: Specification
    """The specification."""
    path: Path1D
    """The flyer's motion."""
    end: float
    """Time from start to end of the record [s]."""
    frames: FloatArray
    """True times of the frames from the start on, static ones below or at 0 [s], shape [n_frames]."""

    @property
    def last(self) -> float:
        """Time from the start that is simulated [s]."""
        late = abs(self.quantities.imperfections.trigger) + abs(self.quantities.transmitted.delay)
        return self.end + MARGIN + late

    @classmethod
    def of(cls, quantities: Specification, folder: Path = Path()) -> "Job":
        """The simulation that a specification asks for; files that it names are in `folder`.

        Raises
        ------
        ValueError
            If its motion cannot be.
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
        """Shots of one group share a model of the solver."""
        q = self.quantities
        relaxing = len(q.material.prony_times)
        support = q.transmission.model_dump_json()
        return (q.specimen, q.truth, q.material.law, relaxing, self.contact, support)


def simulate_truths(
    specifications: Sequence[Specification],
    *,
    folder: Path = Path(),
    device: str = "cpu",
    threads: int | None = None,
) -> list[Truth]:
    """Simulate what several shots truly did.

    Parameters
    ----------
    specifications
        One a shot.
    folder
        Where files are that they name.
    device, threads
        As in `explicit.run`.

    Raises
    ------
    TruthError
        If a simulation did not reach its end.
    ValueError
        If a specification cannot be simulated.
    """
    jobs = [Job.of(quantities, folder) for quantities in specifications]
    groups: dict[Hashable, list[int]] = {}
    for number, job in enumerate(jobs):
        groups.setdefault(job.group, []).append(number)
    truths: dict[int, Truth] = {}
    for members in groups.values():
        found = _group([jobs[number] for number in members], device, threads)
        truths.update(zip(members, found, strict=True))
    return [truths[number] for number in range(len(jobs))]


def _group(jobs: Sequence[Job], device: str, threads: int | None) -> list[Truth]:
    """Truths of jobs with one model; those whose flyer tilts are run once more for what the cameras see."""
    shift = [np.zeros(0)] * len(jobs)
    response = _run(jobs, shift, device, threads)
    tilts = [_tilt(job, response, row) for row, job in enumerate(jobs)]
    seen = response
    if any(np.any(tilt) for tilt in tilts):
        shift = [tilt * 0.5 * job.quantities.specimen.diameter for job, tilt in zip(jobs, tilts, strict=True)]
        seen = _run(jobs, shift, device, threads)
    return [_truth(job, response, seen, row, tilts[row]) for row, job in enumerate(jobs)]


def _run(
    jobs: Sequence[Job], shift: Sequence[FloatArray], device: str, threads: int | None
) -> explicit.Response:
    """Simulate jobs; `shift` is added to the flyer's displacement, at the times of the force [m]."""
    first = jobs[0].quantities
    last = max(job.last for job in jobs)
    times = _force_times(last)
    surface = np.unique(np.concatenate([job.frames[job.frames > 0.0] for job in jobs]))
    material = [job.quantities.material for job in jobs]
    relaxation = tuple(s for m in material for s in relaxation_of(m.prony_strengths, m.prony_times))
    model = explicit.Model(
        mesh=explicit.cylinder(
            0.5 * first.specimen.diameter,
            first.specimen.length,
            n_radial=first.truth.mesh[0],
            n_axial=first.truth.mesh[1],
            grading=first.truth.grading,
        ),
        density=first.specimen.density,
        materials=tuple(law_of(m.law, m.parameters, m.shear_modulus) for m in material),
        motions=tuple(_motion(job, add, times) for job, add in zip(jobs, shift, strict=True)),
        faces=jobs[0].contact[0],
        side=jobs[0].contact[1],
        support=_support(first),
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
    response = explicit.run(model, samples, sampling, device=device, threads=threads)
    for row, job in enumerate(jobs):
        if response.end_times[row] < job.last * (1.0 - 1e-9):
            raise TruthError(
                f"{job.quantities.name}: the simulation ended {response.describe(row)}: take less "
                "compression, or a finer mesh"
            )
    return response


def _force_times(last: float) -> FloatArray:
    return KNOT * np.arange(int(np.ceil(last / KNOT)) + 1, dtype=np.float64)


def _motion(job: Job, add: FloatArray, times: FloatArray) -> explicit.PlatenMotion:
    """The flyer's motion over the group's time; after its own end it stands."""
    inside = times <= job.last
    held = np.minimum(times, job.last) + job.path.start
    position = job.path.displacement(held)
    velocity = np.where(inside, job.path.velocity(held), 0.0)
    if add.size:
        position = position + np.where(inside, add, add[inside][-1])
        velocity = velocity + np.where(inside, np.gradient(add, KNOT), 0.0)
    return explicit.PlatenMotion(start=0.0, step=KNOT, position=position - position[0], velocity=velocity)


def _support(quantities: Specification) -> explicit.CharacteristicBar:
    bar = _bar(quantities)
    return explicit.RIGID if bar is None else explicit.CharacteristicBar(bar.impedance, bar.round_trip)


def _bar(quantities: Specification) -> Bar | None:
    """The bar behind the transmission platen, None for a rigid one."""
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
    """One shot's truth on its own clock."""
    q, start = job.quantities, job.path.start
    inside = response.force_times <= job.last * (1.0 + 1e-12)
    times = response.force_times[inside]
    moving = job.frames > 0.0
    rows = np.searchsorted(seen.surface_times, job.frames[moving])
    mesh = explicit.cylinder(
        0.5 * q.specimen.diameter,
        q.specimen.length,
        n_radial=q.truth.mesh[0],
        n_axial=q.truth.mesh[1],
        grading=q.truth.grading,
    )
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
