"""Simulation of a shot: numerical choices, batches of runs, elastic parts, force transducers.

`Forward` converts parameter values to a batch of the solver. Parts behind the specimen and parts of the flyer
are linear (`explicit.bars.elastic`). Specimen and parts are simulated alternately until their forces agree
(waveform iteration). Each uses the forces or motions from the last pass of the other. A transducer at the
depth x of a uniform bar measures the force at the face with the delay x / c_0. The inertia of the mass in
front of it adds to the force.

Graded meshes have small elements at the edges of the faces. The edge of a bonded face is a stress
singularity. This singularity causes most of the mesh error in a specimen's ringing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

import explicit
from explicit import Response
from explicit.bars import PulseResponse, Section, pulse_on_bars, pulse_on_mesh, section_force
from explicit.materials import MaterialLaw, marlow_from_curve
from explicit.platens import MovingSupport
from kolsky.bars.flyer.path import FlyerPath
from kolsky.base.apparatus import ElasticBody
from kolsky.base.arrays import FloatArray
from kolsky.base.records import MaterialCurve
from kolsky.inverse.parameters import (
    PARAMETERS,
    SLIDING_LAW,
    Fields,
    any_slides,
    checked_value,
    require_declared,
    require_effect,
    what_relaxes,
)
from kolsky.inverse.settings import Numerics
from kolsky.shot.records import Shot, ShotBase


def at_transducer(shot: ShotBase, response: Response) -> Response:
    """A batch with the transmitted force and impulse at the transducer instead of the platen's face."""
    bar = shot.transmission_bar
    if shot.transducer_depth == 0.0 or bar is None:
        return response
    delay = shot.transducer_depth / bar.wave_speed

    def seen(history: FloatArray) -> FloatArray:
        times = response.force_times
        return np.stack(
            [section_force(times, row, delay=delay, round_trip=bar.round_trip) for row in history]
        )

    force_transmission = seen(response.force_transmission)
    impulse_transmission = seen(response.impulse_transmission)
    return replace(response, force_transmission=force_transmission, impulse_transmission=impulse_transmission)


AGREED = 1e-3
"""Convergence limit [-]: rms change of the forces of specimen and parts between two passes over their rms."""
MOST_PASSES = 8
"""Maximum number of passes."""

RunBatches = Callable[[Sequence[explicit.Problem]], list[explicit.Response]]


def in_surroundings(
    shots: Sequence[ShotBase], problems: Sequence[explicit.Problem], run: RunBatches
) -> list[explicit.Response]:
    """Run one batch per shot with the shot's elastic parts by ``run``; return the forces at the transducers.

    Raises ValueError if a specimen and its elastic parts do not agree within `MOST_PASSES` passes.
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
    """A batch with platens that follow the shot's elastic parts under the forces of the last pass."""
    model, samples = problem.model, problem.samples
    times = _knots(model)
    if shot.behind is not None:
        parts = _pulse(shot, shot.behind, times)
        paths = -parts.histories(_impulses_at(response.impulse_transmission, response, times), "path")
        moved = [
            explicit.PlatenMotion(
                start=float(times[0]),
                step=float(times[1] - times[0]),
                position=row - row[0],
                velocity=CubicSpline(times, row)(times, 1),
            )
            for row in paths
        ]
        model = replace(model, support=MovingSupport(tuple(moved)))
    if shot.flyer_body is not None:
        parts = _pulse(shot, shot.flyer_body, times)
        impulse = _impulses_at(response.impulse_flyer, response, times)
        # The parts between the measured section and the face deform. Their shortening reduces the motion of
        # the face.
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
    """A batch in which the forces at the transducers replace those on the platens' faces."""
    times = _knots(problem.model)
    if shot.behind is None:
        response = at_transducer(shot, response)
    elif shot.behind.transducer_depth > 0.0:
        force = _pulse(shot, shot.behind, times).histories(
            _impulses_at(response.impulse_transmission, response, times), "section"
        )
        force, impulse = _recorded(times, force, response, response.force_transmission)
        response = replace(response, force_transmission=force, impulse_transmission=impulse)
    if shot.incident is None:
        return response
    speeds = {
        m: CubicSpline(times, problem.model.motions[m].velocity) for m in {*problem.samples.motion.tolist()}
    }
    since = response.force_times
    gained = np.array([speeds[m](since) for m in problem.samples.motion.tolist()])
    push = np.array([speeds[m](since, 1) for m in problem.samples.motion.tolist()])
    force, impulse, mass = response.force_flyer, response.impulse_flyer, shot.incident.mass
    body = shot.flyer_body
    if body is not None:
        if body.transducer_depth == 0.0:
            return response
        # The load behind the flyer moves it as a rigid body. This part of the motion is the measured motion
        # minus the part due to the specimen's force.
        mass, share = mass_before(body), 1.0 / mass_before(body, body.length)
        push, gained = push + share * force, gained + share * impulse
        waves = _pulse(shot, body, times).histories(_impulses_at(impulse, response, times), "section")
        force, impulse = _recorded(times, waves, response, force)
    # m a = F_transducer - F_specimen, for the mass in front of the transducer.
    return replace(response, force_flyer=force + mass * push, impulse_flyer=impulse + mass * gained)


def mass_before(body: ElasticBody, depth: float | None = None) -> float:
    """Mass of the parts between the face and a section [kg]. Default: the section of the transducer."""
    rest, mass = body.transducer_depth if depth is None else depth, 0.0
    for part in body.parts:
        mass += part.density * 0.25 * np.pi * part.diameter**2 * min(part.length, max(rest, 0.0))
        rest -= part.length
    return mass


def _apart(before: explicit.Response, now: explicit.Response) -> float:
    """Root mean square change of the forces, divided by that of the forces, up to the failure of a run."""
    pairs = ((before.force_transmission, now.force_transmission), (before.force_flyer, now.force_flyer))
    changes = []
    for a, b in pairs:
        both = np.isfinite(a) & np.isfinite(b)
        size = float((b[both] ** 2).sum())
        changes.append(np.sqrt(float(((b - a)[both] ** 2).sum()) / size) if size > 0.0 else 0.0)
    return max(changes)


def _knots(model: explicit.Model) -> FloatArray:
    motion = model.motions[0]
    return motion.start + motion.step * np.arange(len(motion.position), dtype=np.float64)


def _impulses_at(impulse: FloatArray, response: explicit.Response, times: FloatArray) -> FloatArray:
    """Impulses at other times [N s], starting at zero; NaN after the failure of a run."""
    return np.stack([np.interp(times, response.force_times, row, left=0.0) for row in impulse])


def _recorded(
    times: FloatArray, force: FloatArray, response: explicit.Response, known: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Force and impulse at the response's times, from the force at other times; NaN after a failure."""
    step = np.diff(times)
    summed = np.cumsum(0.5 * step * (force[:, 1:] + force[:, :-1]), axis=1)
    impulse = np.concatenate([np.zeros((len(force), 1)), summed], axis=1)
    lost = ~np.isfinite(known)
    found = []
    for rows in (force, impulse):
        seen = np.stack([np.interp(response.force_times, times, row) for row in rows])
        found.append(np.where(lost, np.nan, seen))
    return found[0], found[1]


def _pulse(shot: ShotBase, body: ElasticBody, times: FloatArray) -> PulseResponse:
    step = round(float(times[-1] - times[0]) / (len(times) - 1), 15)
    return _pulse_response(body, shot.specimen.radius, step, len(times))


@lru_cache(maxsize=16)
def _pulse_response(body: ElasticBody, radius: float, step: float, n: int) -> PulseResponse:
    """The parts' response to a pulse on the specimen's area, or on the whole face."""
    sections = tuple(
        Section(part.length, 0.5 * part.diameter, part.youngs_modulus, part.density, part.poisson)
        for part in body.parts
    )
    places = {"sensor": body.transducer_depth, "observed": body.seen_at}
    if body.model == "bar":
        return pulse_on_bars(sections, step=step, n=n, **places)
    pressed = min(radius, sections[0].radius)
    return pulse_on_mesh(sections, step=step, n=n, size=body.element_size, radius=pressed, **places)


MOTION_KNOTS = 2049
"""Knots of the flyer's motion in the solver: one each 0.7 us in a 1.5 ms test, far below a camera frame."""
MESHES = 16
"""Number of cached meshes with their constants; enough for one identification."""
LEDGER_EVERY = 16
"""Number of surface times between two entries of the energy ledger of a surrogate's run."""


@dataclass(frozen=True)
class Forward:
    """A shot prepared for repeated simulation."""

    shot: Shot
    sampling: explicit.Sampling
    """Output times of its instruments."""
    paths: tuple[FlyerPath, ...]
    """The fitted flyer path first, then replicates of it."""
    laws: tuple[MaterialLaw, ...]
    """The law of the quasi-static curve first, then replicates of it."""
    most_steps: int = explicit.Stepping.max_steps
    """Number of steps after which a run fails."""

    def run(
        self,
        points: Mapping[str, ArrayLike],
        numerics: Numerics,
        *,
        motion: ArrayLike = 0,
        material: ArrayLike = 0,
        all_nodes: bool = False,
        progress: Callable[[int], None] | None = None,
    ) -> explicit.Response:
        """Simulate the shot at some points.

        ``points``: parameter name -> values, shape [n] or scalar; other parameters have the shot's value. If
        a parameter that `slides` ("friction") is named, faces and side surface slide by Coulomb's law.
        ``numerics``: mesh, precision, device. ``motion``, ``material``: index of the flyer path and of the
        law of each run, scalar or [n]. ``all_nodes``: True to record every node, and the energy ledger at
        every surface time, not at every `LEDGER_EVERY`-th; not with `Numerics.compressible`, whose meshes
        have no common nodes. ``progress``: called with the number of runs just finished.

        Raises ValueError if a name is unknown, a value is outside its allowed range or outside that of
        `Numerics.compressible`, or a parameter has no effect.
        """
        problem = self.problem(points, numerics, motion=motion, material=material, all_nodes=all_nodes)
        device, threads = numerics.device, numerics.threads
        if numerics.compressible is None:

            def run(problems: Sequence[explicit.Problem]) -> list[explicit.Response]:
                (p,) = problems
                return [
                    explicit.run(
                        p.model,
                        p.samples,
                        p.sampling,
                        stepping=p.stepping,
                        device=device,
                        threads=threads,
                        progress=progress if p is problem else None,
                    )
                ]

            (response,) = in_surroundings([self.shot], [problem], run)
            return response
        if self.shot.behind is not None or self.shot.flyer_body is not None:
            raise ValueError(
                "the correction for Poisson's ratio does not cover elastic parts: run it directly"
            )
        half, less = numerics.coarser()
        corrected = explicit.run_nearly_incompressible(
            problem.model,
            (self.mesh(half), self.mesh(less)),
            problem.samples,
            replace(problem.sampling, all_nodes=False),
            compressible=numerics.compressible,
            stepping=problem.stepping,
            device=device,
            threads=threads,
            progress=progress,
        )
        return as_recorded(self.shot, problem, corrected.response)

    def problem(
        self,
        points: Mapping[str, ArrayLike],
        numerics: Numerics,
        *,
        motion: ArrayLike = 0,
        material: ArrayLike = 0,
        all_nodes: bool = False,
    ) -> explicit.Problem:
        """The batch that `run` simulates, with its arguments and errors, to be run beside other shots."""
        interface = self.shot.interface
        require_effect(points, interface.faces, interface.side)
        require_declared(points, self.shot)
        values = {name: np.asarray(value, dtype=float) for name, value in points.items()}
        for name, value in values.items():
            for x in value.ravel():
                checked_value(name, float(x))
        fields: Fields = {}
        for name, p in PARAMETERS.items():
            if p.belongs_to(self.shot):
                used = values[name] if name in values else p.held(self.shot)
                fields = {**fields, name: used} if p.enters is None else p.enters(fields, used)
        fields, relaxing = what_relaxes(fields, self.shot.relaxation)
        samples = explicit.Samples.of(
            **fields,
            contact_stiffness=interface.contact_stiffness,
            motion=np.asarray(motion, dtype=np.int64),
            material=np.asarray(material, dtype=np.int64),
        )
        model = replace(self.model(numerics, sliding=any_slides(points)), relaxation=relaxing)
        sampling = replace(self.sampling, ledger_every=1 if all_nodes else LEDGER_EVERY)
        stepping = explicit.Stepping(
            safety=numerics.safety, precision=numerics.precision or "fp64", max_steps=self.most_steps
        )
        return explicit.Problem(model, samples, replace(sampling, all_nodes=all_nodes), stepping)

    def model(self, numerics: Numerics, *, sliding: bool = False) -> explicit.Model:
        """The solver's model of the shot; `sliding` replaces the declared interface by Coulomb's law.

        The relaxation is the declared one. Samples that vary the relaxation define it themselves, see `run`.
        """
        shot = self.shot
        relaxing = () if shot.relaxation is None else what_relaxes(shot.relaxation.values, shot.relaxation)[1]
        faces, side = (SLIDING_LAW, SLIDING_LAW) if sliding else (shot.interface.faces, shot.interface.side)
        return explicit.Model(
            mesh=self.mesh(numerics),
            density=shot.specimen.density,
            materials=self.laws,
            motions=tuple(_path_motion(path) for path in self.paths),
            faces=faces,
            side=side,
            support=_support(shot),
            damping_kind="full" if shot.model.damping_kind == "full" else "deviatoric",
            past_data=numerics.past_data,
            element=numerics.element,
            hourglass_form=numerics.hourglass_form,
            relaxation=relaxing,
        )

    def mesh(self, numerics: Numerics) -> explicit.Mesh:
        """The specimen's mesh. It is cached because its constants are expensive."""
        specimen = self.shot.specimen
        return _cylinder(specimen.radius, specimen.length, *numerics.mesh, numerics.grading)


@lru_cache(maxsize=MESHES)
def _cylinder(radius: float, length: float, n_radial: int, n_axial: int, grading: float) -> explicit.Mesh:
    return explicit.cylinder(radius, length, n_radial=n_radial, n_axial=n_axial, grading=grading)


def material_law(curve: MaterialCurve) -> MaterialLaw:
    """The closed-form law of a curve if it has one, otherwise Marlow's law."""
    return curve.law or marlow_from_curve(curve.stretch, curve.stress)


def curve_replicates(curve: MaterialCurve, n: int, rng: np.random.Generator) -> Sequence[MaterialLaw]:
    """Laws of `n` curves drawn from the curve's noise, of which a part is common to all points.

    All stresses of a closed-form law are multiplied by one lognormal factor.
    """
    if curve.law is not None:
        share = float(curve.total_sigma[-1] / abs(curve.stress[-1]))
        return [curve.law.scaled(float(factor)) for factor in np.exp(share * rng.standard_normal(n))]
    noise = curve.sigma * rng.standard_normal((n, len(curve.stress)))
    if curve.modes is not None:
        noise = noise + rng.standard_normal((n, len(curve.modes))) @ curve.modes
    return [marlow_from_curve(curve.stretch, curve.stress + row) for row in noise]


def _path_motion(path: FlyerPath) -> explicit.PlatenMotion:
    times, position, velocity = path.table(MOTION_KNOTS)
    step = float(times[-1] - times[0]) / (len(times) - 1)
    return explicit.PlatenMotion(start=float(times[0]), step=step, position=position, velocity=velocity)


def _support(shot: Shot) -> explicit.CharacteristicBar:
    if shot.support == "rigid" or shot.transmission_bar is None:
        return explicit.RIGID
    bar = shot.transmission_bar
    return explicit.CharacteristicBar(impedance=bar.impedance, round_trip=bar.round_trip)


GRADING = 5.0
"""Largest over smallest element."""
SHARE = 0.625
"""Elements across the radius of the coarser graded mesh, divided by those of the finer one [-]."""


def graded(numerics: Numerics, refined: tuple[int, int]) -> Numerics:
    """Numerics with a graded mesh of as many elements as the refined mesh."""
    return replace(numerics, mesh=refined, grading=GRADING)


def coarser_graded(numerics: Numerics, refined: tuple[int, int]) -> Numerics:
    """A graded mesh at a quarter of the cost. Its ringing is as accurate as that of the refined mesh."""
    across, along = refined
    return graded(numerics, (round(SHARE * across), round(SHARE * along)))
