"""Results of a batch: NumPy float64 arrays, one row a simulation."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from explicit.arrays import FloatArray
from explicit.energy import EnergyLedger
from explicit.outcome import Ending, Outcome


@dataclass(frozen=True)
class Response:
    """Histories of a batch, sampled at the requested times.

    Times are those asked for in `explicit.Sampling`. A simulation that ended early keeps what it recorded
    until then and has NaN after it: positions and ledger to its `end_times` entry, forces to the step before,
    since a force is known when its step is made. `ending` says why, when and where. Forces are
    compression-positive.
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
    """The element where each simulation failed (its `Outcome.role` says what singles it out), -1 where it
    completed, shape [n_samples]."""
    failed_places: FloatArray
    """Centre (R, Y) of that element in the undeformed mesh, Y above the transmission platen [m], NaN where
    the simulation completed, shape [n_samples, 2]."""
    end_times: FloatArray
    """Time each simulation reached [s], shape [n_samples]."""
    steps: NDArray[np.int64]
    """Time steps taken, shape [n_samples]."""
    smallest_step: FloatArray
    """Smallest time step [s], shape [n_samples]."""
    extrapolated_share: FloatArray
    """Largest share of the specimen's volume that was strained past the material curve's data [-],
    shape [n_samples]."""
    largest_strain_measure: FloatArray
    """Largest s = sqrt(I1_bar - 3) met at a surface time [-], shape [n_samples]."""
    nodes: FloatArray | None = None
    """Positions (r, y) of all nodes at the surface times, if asked for [m],
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
        """End of one simulation: outcome, time and place.

        Raises
        ------
        ValueError
            If there is no such simulation.
        """
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
