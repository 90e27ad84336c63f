"""What a wrong input would have done to a prediction: scale, zero, clocks, offsets, applied to one run.

A simulation does not know when its clock started: a flyer's record that is late by L makes every prediction
late by L, and needs no other run. So do scales and offsets of what was measured.
"""

from dataclasses import dataclass
from math import hypot

import numpy as np

from explicit import Response
from kolsky.base.arrays import FloatArray
from kolsky.inverse.observations import Observations
from kolsky.inverse.side_surface import radius_at

NODES = 7
"""Nodes of the mean over a contact that spreads; exact for polynomials in time of degree 13."""


@dataclass(frozen=True)
class Alteration:
    """A change of the predictions of one run."""

    force_factor: float = 1.0
    """The force is so many times the simulated one [-]."""
    force_offset: float = 0.0
    """And so much larger [N]."""
    force_lag: float = 0.0
    """The force comes so much later [s]."""
    spread: float = 0.0
    """The force begins over times so much earlier to so much later, as over a tilted round face [s]."""
    outline_lag: float = 0.0
    """The outline comes so much later [s]."""
    y_offset: float = 0.0
    """The outline's points lie so much higher than their file says [m]."""
    Z_offset: float = 0.0
    """And so much further from the axis [m]."""

    def then(self, other: "Alteration") -> "Alteration":
        """Both alterations: factors multiply, lags and offsets add, spreads add in quadrature."""
        return Alteration(
            force_factor=self.force_factor * other.force_factor,
            force_offset=self.force_offset * other.force_factor + other.force_offset,
            force_lag=self.force_lag + other.force_lag,
            spread=hypot(self.spread, other.spread),
            outline_lag=self.outline_lag + other.outline_lag,
            y_offset=self.y_offset + other.y_offset,
            Z_offset=self.Z_offset + other.Z_offset,
        )

    @property
    def sight(self) -> tuple[float, float]:
        """What tells the radii of `radii` under this alteration from those under another: lag and height."""
        return self.outline_lag, self.y_offset

    def vector(
        self,
        response: Response,
        observations: Observations,
        sample: int = 0,
        *,
        radii: FloatArray | None = None,
    ) -> FloatArray:
        """Force bins [N], then the radii at all outline points [m], shape [k]; NaN where none is known.

        `radii` are those of the same run under an alteration of the same `sight`, where they are known.
        """
        force = observations.of_forces(lambda bins, which: self._force(response, bins.edges, sample, which))
        if not observations.has_shape:
            return force
        known = self.radii(response, observations, sample) if radii is None else radii
        return np.concatenate([force, known - self.Z_offset])

    def _force(self, response: Response, edges: FloatArray, sample: int, which: str) -> FloatArray:
        """Means of a force between the edges, as altered [N]; the incident one has its own scale and zero."""
        t = response.force_times
        impulse, force = response.impulse_transmission[sample], response.force_transmission[sample]
        if which == "flyer":
            impulse, force = response.impulse_flyer[sample], response.force_flyer[sample]
        lags, weights = contact_spread(self.spread) if self.spread > 0.0 else (np.zeros(1), np.ones(1))
        mean = np.zeros(len(edges) - 1)
        for lag, weight in zip(lags, weights, strict=True):
            at = edges - self.force_lag - lag
            known = np.interp(at, t, impulse) + np.maximum(at - t[-1], 0.0) * force[-1]
            mean += weight * np.diff(known) / np.diff(edges)
        return mean if which == "flyer" else np.asarray(self.force_factor * mean + self.force_offset)

    def radii(self, response: Response, observations: Observations, sample: int = 0) -> FloatArray:
        """Radii at the points without the offset from the axis [m], linear in time between the frames and
        beyond the last; at rest before the first. None of a shot without an outline."""
        if not observations.has_shape:
            return np.zeros(0)
        line, times = observations.centre_line, response.surface_times
        r, y = response.surface_r[sample], response.surface_y[sample]
        at = np.maximum(line.time - self.outline_lag, times[0])
        row = np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(times) - 2)
        part = (at - times[row]) / (times[row + 1] - times[row])
        exact = np.abs(part - np.rint(part)) < 1e-6
        part = np.where(exact, np.rint(part), part)
        height = line.y + self.y_offset
        found = np.zeros(len(height))
        for step, weight in ((0, 1.0 - part), (1, part)):
            use = weight != 0.0
            radius, _ = radius_at(r, y, row[use] + step, height[use])
            found[use] += weight[use] * radius
        return found


UNALTERED = Alteration()


def contact_spread(half: float) -> tuple[FloatArray, FloatArray]:
    """Delays of the strips of a tilted round face, and their shares of its area.

    The face's chord at the distance x from the middle has the length 2 sqrt(R^2 - x^2): the delays have the
    density of a semicircle, whose Gauss quadrature is Chebyshev's of the second kind.

    Parameters
    ----------
    half
        Delay of the rim against the middle [s].
    """
    angle = np.pi * np.arange(1, NODES + 1) / (NODES + 1)
    return half * np.cos(angle), 2.0 * np.sin(angle) ** 2 / (NODES + 1)
