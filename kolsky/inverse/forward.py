"""From a shot and parameter values to a batch of simulations of that very test."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

import explicit
from explicit.materials import MaterialLaw, marlow_from_curve
from kolsky.bars.flyer.path import FlyerPath
from kolsky.base.records import MaterialCurve
from kolsky.inverse.parameters import (
    PARAMETERS,
    SLIDING_LAW,
    Fields,
    any_slides,
    checked_value,
    require_declared,
    require_effect,
)
from kolsky.inverse.relaxing import what_relaxes
from kolsky.inverse.surroundings import as_recorded, in_surroundings
from kolsky.shot.records import Shot

MOTION_KNOTS = 2049
"""Knots of the flyer's motion in the solver: 0.7 us apart on a 1.5 ms test, far below a camera frame."""
MESHES = 16
"""Most meshes that are kept, with what is computed from them: those of an identification."""
LEAST_ACROSS = 10
"""Fewest elements across the radius of a mesh that corrects for Poisson's ratio."""
LEDGER_EVERY = 16
"""Surface times between two entries of the energy ledger of a run that only feeds a surrogate."""


@dataclass(frozen=True)
class Numerics:
    """Numerical choices of a run; they are part of every result's provenance."""

    mesh: tuple[int, int] = (24, 32)
    """Elements across the radius and along the length."""
    grading: float = 2.0
    """Largest over smallest element; the small ones lie at the surface, where the specimen rolls over."""
    safety: float = 0.9
    """Share of the stability bound a step uses."""
    precision: Literal["fp32", "fp64"] = "fp64"
    """Arithmetic of the solver."""
    device: str = "cpu"
    """ "cpu" or a CUDA device."""
    threads: int | None = None
    """CPU threads; all cores if left out."""
    past_data: Literal["continue", "stop"] = "continue"
    """Whether a run ends where its material is strained past the quasi-static curve, see
    `explicit.Model.past_data`."""
    element: str = "one_point"
    """The element: a name of `explicit.elements.ELEMENTS`."""
    hourglass_form: Literal["stiffness", "viscous"] = "stiffness"
    """Hourglass control of the one-point element, see `explicit.Model.hourglass_form`."""
    compressible: float | None = None
    """Poisson's ratio at which the mesh is run and corrected to the wanted one on coarser meshes, see
    `explicit.run_nearly_incompressible`; None runs it directly. Every wanted ratio must lie above."""

    def with_mesh(self, mesh: tuple[int, int]) -> "Numerics":
        """The same choices on another mesh."""
        return replace(self, mesh=mesh)

    def with_other_element(self) -> "Numerics":
        """The same choices with the other element, by which the mesh's error is told."""
        return replace(self, element="fbar" if self.element == "one_point" else "one_point")

    def coarser(self) -> tuple["Numerics", "Numerics"]:
        """The meshes that correct for Poisson's ratio: half as fine, and three quarters of that.

        Raises
        ------
        ValueError
            If the mesh has too few elements across the radius.
        """
        if self.mesh[0] < LEAST_ACROSS + 2:
            raise ValueError(
                f"correcting for Poisson's ratio needs {LEAST_ACROSS + 2} elements or more across the "
                f"radius, got {self.mesh[0]}: run it directly"
            )
        share = max(0.5, LEAST_ACROSS / self.mesh[0])
        half = round(share * self.mesh[0]), round(share * self.mesh[1])
        return self.with_mesh(half), self.with_mesh((round(0.75 * half[0]), round(0.75 * half[1])))


@dataclass(frozen=True)
class Forward:
    """A shot made ready to be simulated, many times."""

    shot: Shot
    """The shot."""
    sampling: explicit.Sampling
    """When its instruments looked."""
    paths: tuple[FlyerPath, ...]
    """The fitted flyer path first, then replicates of it."""
    laws: tuple[MaterialLaw, ...]
    """The law of the quasi-static curve first, then replicates of it."""

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

        Parameters
        ----------
        points : mapping
            Parameter name -> values, shape [n] or scalar; the shot's own value where a name is missing.
            Naming one that `slides` ("friction") makes both the faces and the side surface slide by
            Coulomb's law; one that a contact law must read asks for a shot that declares such a law.
        numerics
            Mesh, precision, device.
        motion, material : int or shape [n]
            Which flyer path and material law each run takes.
        all_nodes : bool
            Record every node, for pictures, and the energy ledger at every surface time; else at every
            `LEDGER_EVERY`-th. With `Numerics.compressible` there are no common nodes, and none are recorded.
        progress : callable, optional
            Called with the number of runs just finished.

        Raises
        ------
        ValueError
            If a name is unknown, a value is outside its allowed range, also that of `Numerics.compressible`,
            or a parameter would have no effect.
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
                "a run corrected for Poisson's ratio is not known beside elastic parts: run it directly"
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
        """The batch that `run` simulates, for batches of several shots side by side.

        Parameters
        ----------
        points, numerics, motion, material, all_nodes
            As of `run`.

        Raises
        ------
        ValueError
            As `run`.
        """
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
                fields = p.entered(fields, values.get(name, p.held(self.shot)))
        fields, relaxing = what_relaxes(fields, self.shot.relaxation)
        samples = explicit.Samples.of(
            **fields,
            contact_stiffness=interface.contact_stiffness,
            motion=np.asarray(motion, dtype=np.int64),
            material=np.asarray(material, dtype=np.int64),
        )
        model = replace(self.model(numerics, sliding=any_slides(points)), relaxation=relaxing)
        sampling = replace(self.sampling, ledger_every=1 if all_nodes else LEDGER_EVERY)
        stepping = explicit.Stepping(safety=numerics.safety, precision=numerics.precision)
        return explicit.Problem(model, samples, replace(sampling, all_nodes=all_nodes), stepping)

    def model(self, numerics: Numerics, *, sliding: bool = False) -> explicit.Model:
        """The solver's model of the shot; `sliding` replaces the declared interface by Coulomb's law.

        What relaxes is as the shot declares it; samples that vary it bring their own, see `run`.
        """
        shot = self.shot
        relaxing = () if shot.relaxation is None else what_relaxes(shot.relaxation.values, shot.relaxation)[1]
        faces, side = (SLIDING_LAW, SLIDING_LAW) if sliding else (shot.interface.faces, shot.interface.side)
        return explicit.Model(
            mesh=self.mesh(numerics),
            density=shot.specimen.density,
            materials=self.laws,
            motions=tuple(_motion(path) for path in self.paths),
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
        """The specimen's mesh, the same one when it is asked for again: its constants are made once."""
        specimen = self.shot.specimen
        return _cylinder(specimen.radius, specimen.length, *numerics.mesh, numerics.grading)


@lru_cache(maxsize=MESHES)
def _cylinder(radius: float, length: float, n_radial: int, n_axial: int, grading: float) -> explicit.Mesh:
    return explicit.cylinder(radius, length, n_radial=n_radial, n_axial=n_axial, grading=grading)


def material_law(curve: MaterialCurve) -> MaterialLaw:
    """The closed-form law that a curve belongs to, or else Marlow's law of it."""
    return curve.law or marlow_from_curve(curve.stretch, curve.stress)


def curve_replicates(curve: MaterialCurve, n: int, rng: np.random.Generator) -> Sequence[MaterialLaw]:
    """Laws of `n` curves drawn from the curve's noise: of each point alone, and of all points together.

    A closed-form law varies by a factor on all its stresses, whose logarithm is normal.
    """
    if curve.law is not None:
        share = float(curve.total_sigma[-1] / abs(curve.stress[-1]))
        return [curve.law.scaled(float(factor)) for factor in np.exp(share * rng.standard_normal(n))]
    noise = curve.sigma * rng.standard_normal((n, len(curve.stress)))
    if curve.modes is not None:
        noise = noise + rng.standard_normal((n, len(curve.modes))) @ curve.modes
    return [marlow_from_curve(curve.stretch, curve.stress + row) for row in noise]


def _motion(path: FlyerPath) -> explicit.PlatenMotion:
    times, position, velocity = path.table(MOTION_KNOTS)
    step = float(times[-1] - times[0]) / (len(times) - 1)
    return explicit.PlatenMotion(start=float(times[0]), step=step, position=position, velocity=velocity)


def _support(shot: Shot) -> explicit.CharacteristicBar:
    if shot.support == "rigid" or shot.transmission_bar is None:
        return explicit.RIGID
    bar = shot.transmission_bar
    return explicit.CharacteristicBar(impedance=bar.impedance, round_trip=bar.round_trip)
