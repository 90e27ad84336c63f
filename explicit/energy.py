"""The energy ledger that every simulation returns."""

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from explicit.arrays import FloatArray


@dataclass(frozen=True)
class EnergyLedger:
    """Energy balance: the work of the platens and what it became, at the surface times of a batch.

    Every field is an energy [J], shape [n_samples, n_surface_times]. A field ends in NaN after the end time
    of a simulation that did not complete (see `Response.outcomes`), and is NaN at the times that
    `Sampling.ledger_every` leaves out.
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
    """Lost when a node lands on a platen (inelastic, vanishes with the mesh); with the law "penalty" what
    its normal springs hold or have lost, and in `friction` the tangential ones [J],
    shape [n_samples, n_surface_times]."""
    hourglass_damping: FloatArray
    """Dissipated by hourglass control [J], shape [n_samples, n_surface_times]."""

    viscous: FloatArray
    """Work done on the branches of `Model.relaxation`: dissipated by them, or still held [J]; `elastic` is
    then that of the long-term law. Shape [n_samples, n_surface_times]."""

    @property
    def artificial(self) -> FloatArray:
        """Energy stored and dissipated by hourglass control [J], shape [n_samples, n_surface_times]."""
        return self.hourglass + self.hourglass_damping

    @property
    def residual(self) -> FloatArray:
        """External work minus everything it became [J], shape [n_samples, n_surface_times]."""
        lost = self.damping + self.friction + self.impact + self.viscous
        return self.external - (self.kinetic + self.elastic + self.artificial + lost)

    def imbalance(self) -> FloatArray:
        """Largest |residual| over the largest |external work| of each simulation [-], shape [n_samples]."""
        worst = np.nanmax(np.abs(self.residual), axis=1)
        scale = np.nanmax(np.abs(self.external), axis=1)
        return np.divide(worst, scale, out=np.zeros_like(worst), where=scale > 0.0)

    def artificial_share(self) -> FloatArray:
        """Largest artificial energy over the largest strain energy of each simulation [-], shape [n_samples].

        Above 0.01 hourglass control takes part in the answer: refine the mesh, or check with an element that
        has none (`Model.element = "fbar"`).
        """
        worst = np.nanmax(self.artificial, axis=1)
        scale = np.nanmax(self.elastic, axis=1)
        return np.divide(worst, scale, out=np.zeros_like(worst), where=scale > 0.0)

    def select(self, rows: NDArray[np.intp]) -> "EnergyLedger":
        """The ledger of some samples of the batch, in the order of `rows`."""
        return EnergyLedger(**{f.name: getattr(self, f.name)[rows] for f in fields(self)})
