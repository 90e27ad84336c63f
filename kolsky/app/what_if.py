"""Simulation of a shot with other parameters, and its misfit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from threading import Lock

import numpy as np

from kolsky.base.apparatus import SLIDING_LAW
from kolsky.inverse.observations import Prediction, predict
from kolsky.inverse.parameters import PARAMETERS
from kolsky.inverse.problem import PreparedShot, prepare_shot
from kolsky.inverse.result import FORCE, OUTLINE, Identification
from kolsky.inverse.settings import Numerics
from kolsky.shot.records import Shot

SLIDERS = ("stiffness_factor", "poisson", "damping", "friction")
"""Parameters that have a slider if they have an effect. Friction is the last one."""
AROUND = 6.0
"""Half the range of a slider, in standard uncertainties of an identified parameter. It is three times U (k =
2)."""
LEAST_SHARE = 0.06
"""Smallest half range of a slider relative to its value [-]. Without it, well-constrained parameters could
not be moved."""
_ONE_AT_A_TIME = Lock()
"""Allows one simulation at a time, because a simulation uses all threads of the solver."""


@dataclass(frozen=True)
class Misfit:
    """Residual of each channel divided by that of a correct model."""

    force: float
    """Misfit of the force [-]."""
    outline: float
    """Misfit of the outline [-]; NaN if not measured."""


@dataclass(frozen=True)
class Answer:
    """One simulation, compared with the data."""

    prediction: Prediction
    """The predicted data of the instruments."""
    misfit: Misfit
    """Its misfit to the data."""


class WhatIf:
    """A shot with its result, ready to be simulated with other parameters. The mesh is that of the search."""

    def __init__(self, shot: Shot, found: Identification) -> None:
        """Prepare the shot. Raises ValueError if it cannot be simulated."""
        self.found = found
        self.prepared: PreparedShot = prepare_shot(shot)
        self.numerics = Numerics(mesh=found.mesh)
        values = {**found.fixed, **{name: e.value for name, e in found.estimates.items()}}
        slides = "friction" in found.estimates or SLIDING_LAW in (shot.interface.faces, shot.interface.side)
        shown = SLIDERS if slides else SLIDERS[:-1]
        self.start = {name: float(values.get(name, PARAMETERS[name].held(shot))) for name in shown}
        self.others = {name: e.value for name, e in found.estimates.items() if name not in SLIDERS}

    def bounds(self, name: str) -> tuple[float, float]:
        """Range of a parameter's slider, within the allowed range."""
        value, (low, high) = self.start[name], PARAMETERS[name].allowed
        estimate = self.found.estimates.get(name)
        known = AROUND * estimate.sigma if estimate is not None and np.isfinite(estimate.sigma) else 0.0
        if name == "poisson":  # the effect depends on the distance from 0.5
            half = max(known, 5.0 * LEAST_SHARE * (0.5 - value))
        else:
            span = 0.1 * (PARAMETERS[name].upper - PARAMETERS[name].lower)
            half = max(known, 5.0 * LEAST_SHARE * abs(value) if value else span)
        return max(value - half, low), min(value + half, high)

    def run(self, parameters: Mapping[str, float]) -> Answer:
        """Simulate once.

        Raises ValueError if a value is not allowed, or if the run does not complete.
        """
        with _ONE_AT_A_TIME:
            response = self.prepared.forward.run(
                {n: np.array([v]) for n, v in {**self.others, **parameters}.items()}, self.numerics
            )
        if not response.outcomes[0].ok:
            raise ValueError(response.describe(0))
        prediction = predict(response, self.prepared.observations)
        return Answer(prediction, self.misfit(prediction, 0))

    def misfit(self, prediction: Prediction, i: int) -> Misfit:
        """Misfit of one run of a prediction, computed as in the result."""
        observed, expected = self.prepared.observations, {one.channel: one.expected for one in self.found.fit}
        force = np.sqrt(np.mean((prediction.force_bins[i] - observed.force_mean) ** 2))
        outline = np.nan
        if observed.has_shape:
            inside = prediction.inside[i]
            outline = np.sqrt(np.mean((prediction.Z[i, inside] - observed.centre_line.Z[inside]) ** 2))
        return Misfit(*(float(a / expected.get(n, np.nan)) for n, a in ((FORCE, force), (OUTLINE, outline))))
