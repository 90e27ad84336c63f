"""Results of a batch: histories, energy ledger, and the outcome of each simulation.

Arrays are NumPy float64 with one row per simulation. A failed simulation has a named cause, its time, its
element and its cure.
"""

from dataclasses import dataclass, fields
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from explicit.arrays import FloatArray


class Outcome(IntEnum):
    """The end of one simulation of a batch.

    The time loop writes the integer values. They are not part of the API.
    """

    COMPLETED = 0
    INVERTED = 1
    DIVERGED = 2
    STEP_COLLAPSED = 3
    STEP_LIMIT = 4
    TABLE_EXCEEDED = 5

    @property
    def ok(self) -> bool:
        """True when the simulation reached its end time."""
        return self is Outcome.COMPLETED

    @property
    def cause(self) -> str:
        """Cause, in one sentence."""
        return _TEXTS[self][0]

    @property
    def cure(self) -> str:
        """Cure: the next step for the user."""
        return _TEXTS[self][1]

    @property
    def role(self) -> str:
        """Part of the named element in the failure; empty if the simulation completed."""
        return _TEXTS[self][2]


_TEXTS = {
    Outcome.COMPLETED: ("the end time was reached", "nothing to do", ""),
    Outcome.INVERTED: (
        "an element turned inside out (J <= 0)",
        "refine the mesh, lower safety, or end the window before the specimen folds; a law far too soft for "
        "the load folds on every mesh: check its unit",
        "the smallest J",
    ),
    Outcome.DIVERGED: (
        "the specimen moves with more energy than the platens gave it, or a force is not a finite number",
        "lower measure_every or safety, end the window before the specimen is crushed, and check that the "
        "material curve does not soften to nothing",
        "the fastest corners",
    ),
    Outcome.STEP_COLLAPSED: (
        "the stable step fell below the share `floor` of its initial value",
        "end the window before the specimen is crushed, lower poisson, or use deviatoric damping",
        "the shortest stable step",
    ),
    Outcome.STEP_LIMIT: (
        "max_steps was used up",
        "raise max_steps or shorten the window",
        "the shortest stable step",
    ),
    Outcome.TABLE_EXCEEDED: (
        "the material was strained past the data of its curve, s = sqrt(I1_bar - 3)",
        "measure the curve to larger strain, end the window earlier, or let the law continue: past_data = "
        '"continue"',
        "the largest s",
    ),
}


@dataclass(frozen=True)
class Ending:
    """End of one simulation: outcome, time and place."""

    outcome: Outcome
    time: float
    """Time of the end [s]."""
    element: int = -1
    """The element where it failed; -1 if it completed."""
    place: tuple[float, float] = (float("nan"), float("nan"))
    """Centre (R, Y) of that element in the undeformed mesh, Y above the transmission platen [m]; NaN if the
    simulation completed."""

    @property
    def where(self) -> str:
        """Time and element, e.g. "at 280.3 us in element 87 (R = 4.45 mm, Y = 6.21 mm)"."""
        moment = f"at {1e6 * self.time:.1f} us"
        if self.element < 0:
            return moment
        r, y = self.place
        return f"{moment} in element {self.element} (R = {1e3 * r:.2f} mm, Y = {1e3 * y:.2f} mm)"

    @property
    def sentence(self) -> str:
        """Cause, time, element and cure, without a final stop."""
        if self.outcome.ok:
            return f"{self.outcome.name} {self.where}"
        element = f"; the element has {self.outcome.role}" if self.element >= 0 else ""
        return f"{self.outcome.name} {self.where}: {self.outcome.cause}{element}. Cure: {self.outcome.cure}"


@dataclass(frozen=True)
class EnergyLedger:
    """Energy balance at the surface times of a batch: the work of the platens and the other energies.

    Every field is an energy [J], shape [n_samples, n_surface_times]. A field is NaN after the end time of a
    simulation that did not complete (see `Response.outcomes`). It is also NaN at the times that
    `Sampling.ledger_every` omits.
    """

    external: FloatArray
    """Work done on the specimen by both platens [J], shape [n_samples, n_surface_times]."""
    kinetic: FloatArray
    """Kinetic energy [J], shape [n_samples, n_surface_times]."""
    elastic: FloatArray
    """Strain energy of the material law [J], shape [n_samples, n_surface_times]."""
    hourglass: FloatArray
    """Energy stored by the hourglass control [J], shape [n_samples, n_surface_times]."""
    damping: FloatArray
    """Dissipated by stiffness- and mass-proportional damping [J], shape [n_samples, n_surface_times]."""
    friction: FloatArray
    """Dissipated by sliding and sticking on the platens [J], shape [n_samples, n_surface_times]."""
    impact: FloatArray
    """Energy lost when a node hits a platen [J], shape [n_samples, n_surface_times]. The impact is inelastic;
    the loss vanishes with mesh refinement. With the law "penalty" it is the energy of the normal springs,
    stored or dissipated. That of the tangential springs is in `friction`."""
    hourglass_damping: FloatArray
    """Dissipated by hourglass control [J], shape [n_samples, n_surface_times]."""

    viscous: FloatArray
    """Work done on the branches of `Model.relaxation` [J], shape [n_samples, n_surface_times]. It is
    dissipated or still stored. `elastic` is then the energy of the long-term law."""

    @property
    def artificial(self) -> FloatArray:
        """Energy stored and dissipated by hourglass control [J], shape [n_samples, n_surface_times]."""
        return self.hourglass + self.hourglass_damping

    @property
    def residual(self) -> FloatArray:
        """External work minus all other energies [J], shape [n_samples, n_surface_times]."""
        dissipated = self.damping + self.friction + self.impact + self.viscous
        return self.external - (self.kinetic + self.elastic + self.artificial + dissipated)

    def imbalance(self) -> FloatArray:
        """Largest |residual| over the largest |external work| of each simulation [-], shape [n_samples]."""
        worst = np.nanmax(np.abs(self.residual), axis=1)
        scale = np.nanmax(np.abs(self.external), axis=1)
        return np.divide(worst, scale, out=np.zeros_like(worst), where=scale > 0.0)

    def artificial_share(self) -> FloatArray:
        """Largest artificial energy over the largest strain energy of each simulation [-], shape [n_samples].

        Above 0.01 hourglass control affects the result. Refine the mesh, or check with an element without
        hourglass control (`Model.element = "fbar"`).
        """
        worst = np.nanmax(self.artificial, axis=1)
        scale = np.nanmax(self.elastic, axis=1)
        return np.divide(worst, scale, out=np.zeros_like(worst), where=scale > 0.0)

    def select(self, rows: NDArray[np.intp]) -> "EnergyLedger":
        """The ledger of some samples of the batch, in the order of `rows`."""
        return EnergyLedger(**{f.name: getattr(self, f.name)[rows] for f in fields(self)})


@dataclass(frozen=True)
class Response:
    """Histories of a batch, sampled at the requested times.

    Times are those of `explicit.Sampling`. A simulation that ended early has its records up to its end,
    followed by NaN. Positions and ledger end at its `end_times` entry. Forces end one step earlier, because a
    force is known only after its step. `ending` gives cause, time and place. Forces are compression-positive.
    """

    force_times: FloatArray
    """Times of the force samples [s], shape [n_force_times]."""
    force_flyer: FloatArray
    """Force of the flyer's platen on the specimen [N], shape [n_samples, n_force_times]."""
    force_transmission: FloatArray
    """Force of the specimen on the transmission platen [N], shape [n_samples, n_force_times]."""
    impulse_flyer: FloatArray
    """Time integral of the flyer force [N s], shape [n_samples, n_force_times]."""
    impulse_transmission: FloatArray
    """Time integral of the transmission force [N s], shape [n_samples, n_force_times]."""
    surface_times: FloatArray
    """Times of the surface samples [s], shape [n_surface_times]."""
    surface_r: FloatArray
    """Radius of the side surface's nodes, transmission platen first [m],
    shape [n_samples, n_surface_times, n_surface_nodes]."""
    surface_y: FloatArray
    """Height of the same nodes above the transmission platen's initial plane [m],
    shape [n_samples, n_surface_times, n_surface_nodes]."""
    energy: EnergyLedger
    """Energy ledger at the surface times."""
    outcomes: tuple[Outcome, ...]
    """How each simulation ended, length n_samples."""
    failed_elements: NDArray[np.int64]
    """The element where each simulation failed, shape [n_samples]; -1 where it completed. `Outcome.role`
    gives the element's part in the failure."""
    failed_places: FloatArray
    """Centre (R, Y) of this element in the undeformed mesh, Y above the transmission platen [m], shape
    [n_samples, 2]. NaN where the simulation completed."""
    end_times: FloatArray
    """Time of the end of each simulation [s], shape [n_samples]."""
    steps: NDArray[np.int64]
    """Time steps taken, shape [n_samples]."""
    smallest_step: FloatArray
    """Smallest time step [s], shape [n_samples]."""
    extrapolated_share: FloatArray
    """Largest share of the specimen's volume that was strained beyond the data of the material curve [-],
    shape [n_samples]."""
    largest_strain_measure: FloatArray
    """Largest s = sqrt(I1_bar - 3) at any surface time [-], shape [n_samples]."""
    nodes: FloatArray | None = None
    """Positions (r, y) of all nodes at the surface times, if requested [m],
    shape [n_samples, n_surface_times, n_nodes, 2]."""

    @property
    def n_samples(self) -> int:
        """Number of simulations in the batch."""
        return len(self.outcomes)

    @property
    def completed(self) -> NDArray[np.bool_]:
        """Mask of the simulations that reached their end, shape [n_samples]."""
        return np.array([outcome.ok for outcome in self.outcomes], dtype=bool)

    def ending(self, sample: int) -> Ending:
        """End of one simulation: outcome, time and place."""
        if not 0 <= sample < self.n_samples:
            raise ValueError(f"sample must be in [0, {self.n_samples - 1}], got {sample}")
        r, y = self.failed_places[sample]
        return Ending(
            outcome=self.outcomes[sample],
            time=float(self.end_times[sample]),
            element=int(self.failed_elements[sample]),
            place=(float(r), float(y)),
        )

    @property
    def endings(self) -> tuple[Ending, ...]:
        """End of every simulation: outcome, time and place, length n_samples."""
        return tuple(self.ending(i) for i in range(self.n_samples))

    def require_completed(self) -> None:
        """Raise RuntimeError, with cause and cure, if a simulation did not reach its end."""
        for i, outcome in enumerate(self.outcomes):
            if not outcome.ok:
                time = 1e6 * self.end_times[i]
                raise RuntimeError(f"simulation {i} ended at {time:.1f} us: {outcome.cause}; {outcome.cure}")

    def describe(self, sample: int) -> str:
        """The sentence of `ending`, e.g. "INVERTED at 280.3 us in element 87 (R = 4.45 mm, Y = 6.21 mm): an
        element turned inside out (J <= 0); ... Cure: ..."."""
        return self.ending(sample).sentence

    def select(self, rows: NDArray[np.intp] | list[int]) -> "Response":
        """Some simulations of the batch, in the order of `rows`."""
        index = np.asarray(rows, dtype=np.intp)
        return Response(
            force_times=self.force_times,
            force_flyer=self.force_flyer[index],
            force_transmission=self.force_transmission[index],
            impulse_flyer=self.impulse_flyer[index],
            impulse_transmission=self.impulse_transmission[index],
            surface_times=self.surface_times,
            surface_r=self.surface_r[index],
            surface_y=self.surface_y[index],
            energy=self.energy.select(index),
            outcomes=tuple(self.outcomes[i] for i in index),
            failed_elements=self.failed_elements[index],
            failed_places=self.failed_places[index],
            end_times=self.end_times[index],
            steps=self.steps[index],
            smallest_step=self.smallest_step[index],
            extrapolated_share=self.extrapolated_share[index],
            largest_strain_measure=self.largest_strain_measure[index],
            nodes=None if self.nodes is None else self.nodes[index],
        )
