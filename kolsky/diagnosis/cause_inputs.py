"""Effect of a changed input on a run, limits of the change, and the corrected shot.

If a flyer's record is late by L, every prediction is late by L. No run is needed, as for scales and offsets.
"""

from __future__ import annotations

from dataclasses import replace
from math import hypot, isfinite, isnan, nan, pi
from typing import TYPE_CHECKING

import numpy as np

from explicit import Response
from kolsky.bars.signals.transducers import low_pass
from kolsky.base.apparatus import SLIDING_LAW
from kolsky.base.arrays import FloatArray
from kolsky.base.records import FlyerMotion
from kolsky.inverse.observations import Observations, radius_at
from kolsky.inverse.parameters import PARAMETERS, any_slides
from kolsky.inverse.result import COVERAGE, CauseFinding
from kolsky.inverse.settings import Settings
from kolsky.shot.input_records import Cause, Change
from kolsky.shot.inputs import INPUTS
from kolsky.shot.records import ForceChannel, Shot

if TYPE_CHECKING:
    from kolsky.inverse.problem import InverseProblem
    from kolsky.inverse.runner import Runner


SPREAD_NODES = 7
"""Quadrature nodes for the mean over a spreading contact; exact for polynomials in time of degree 13."""


def changed_vector(
    change: Change,
    response: Response,
    observations: Observations,
    sample: int = 0,
    *,
    known: FloatArray | None = None,
) -> FloatArray:
    """Force bins [N], then the radii at all outline points [m], shape [k]; NaN for an unknown radius.

    ``known``: the `radii` of the same run with a change of the same `sight`, if already computed.
    """
    force = observations.of_forces(lambda bins, which: _force(change, response, bins.edges, sample, which))
    if not observations.has_shape:
        return force
    seen = radii(change, response, observations, sample) if known is None else known
    return np.concatenate([force, seen - change.Z_offset])


def _force(change: Change, response: Response, edges: FloatArray, sample: int, which: str) -> FloatArray:
    """Means of a changed force between the edges [N]. The incident force has a separate scale and zero."""
    t = response.force_times
    impulse, force = response.impulse_transmission[sample], response.force_transmission[sample]
    if which == "flyer":
        impulse, force = response.impulse_flyer[sample], response.force_flyer[sample]
    elif change.flyer_share != 0.0:
        # The channel records a weighted mean of its force and that of the other end. The weight is the share.
        share = change.flyer_share
        impulse = (1.0 - share) * impulse + share * response.impulse_flyer[sample]
        force = (1.0 - share) * force + share * response.force_flyer[sample]
    if which != "flyer":
        impulse = _through_amplifier(change, t, impulse)
    lags, weights = contact_spread(change.spread) if change.spread > 0.0 else (np.zeros(1), np.ones(1))
    mean = np.zeros(len(edges) - 1)
    for lag, weight in zip(lags, weights, strict=True):
        at = edges - change.force_lag - lag + (1.0 - change.film) * t[0]
        known = np.interp(at, t, impulse) + np.maximum(at - t[-1], 0.0) * force[-1]
        mean += weight * np.diff(known) / np.diff(edges)
    return mean if which == "flyer" else np.asarray(change.force_factor * mean + change.force_offset)


def _through_amplifier(change: Change, t: FloatArray, impulse: FloatArray) -> FloatArray:
    """An impulse after a slow amplifier and a charge leak. Both are linear."""
    if change.time_constant > 0.0 or change.leak > 0.0:
        step = (t[-1] - t[0]) / (len(t) - 1)
        if change.time_constant > 0.0:
            impulse = low_pass(impulse, step, 1.0 / (2.0 * pi * change.time_constant))
        if change.leak > 0.0:
            impulse = impulse - low_pass(impulse, step, change.leak / (2.0 * pi))
    return impulse


def radii(change: Change, response: Response, observations: Observations, sample: int = 0) -> FloatArray:
    """Radii at the points without the offset from the axis [m], linear in time between and after the frames.

    Before the first frame the specimen is undeformed. Empty for a shot without an outline.
    """
    if not observations.has_shape:
        return np.zeros(0)
    line, times = observations.centre_line, response.surface_times
    r, y = response.surface_r[sample], response.surface_y[sample]
    # The run begins with the window. The times of the frames are scaled about the shot's zero.
    at = times[0] + change.film * (line.time - times[0]) - change.outline_lag
    at = np.maximum(at, times[0])
    row = np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(times) - 2)
    part = (at - times[row]) / (times[row + 1] - times[row])
    exact = np.abs(part - np.rint(part)) < 1e-6
    part = np.where(exact, np.rint(part), part)
    height = change.picture * line.y + change.y_offset
    if not isnan(change.mirror):
        height = y[0].max() + change.mirror - height
    found = np.zeros(len(height))
    for step, weight in ((0, 1.0 - part), (1, part)):
        use = weight != 0.0
        radius, _ = radius_at(r, y, row[use] + step, height[use])
        found[use] += weight[use] * radius
    return found / change.picture


def contact_spread(half: float) -> tuple[FloatArray, FloatArray]:
    """Delays of the strips of a tilted round face, and their shares of its area.

    At the distance x from the middle, the chord of the face has the length 2 sqrt(R^2 - x^2): the delays have
    a semicircular density. Its Gauss quadrature is Chebyshev's of the second kind.
    """
    angle = np.pi * np.arange(1, SPREAD_NODES + 1) / (SPREAD_NODES + 1)
    return half * np.cos(angle), 2.0 * np.sin(angle) ** 2 / (SPREAD_NODES + 1)


def can_be_tried(c: Cause, problem: InverseProblem) -> bool:
    """True if a cause can be tried on this shot. It must be measured, held, and have an effect."""
    shot, settings = problem.shot, problem.settings
    if c.parameter in problem.box.names:
        return False
    if c.needs == "outline":
        return problem.observations.has_shape
    if c.needs == "force channel":
        return isinstance(shot.force, ForceChannel)
    if c.needs == "film of the flyer":
        return isinstance(shot.flyer, FlyerMotion)
    if c.needs == "curve":
        return shot.curve.law is None
    if c.needs == "faces that stick":
        slides = any_slides([*problem.box.names, *settings.held])
        return not slides and shot.interface.faces != SLIDING_LAW
    return True


def start_of(c: Cause, problem: InverseProblem) -> float:
    """Coordinate of the declared value; NaN if there is none."""
    return nan if c.exact != c.exact else c.coordinate(held_value(c, problem))


def held_value(c: Cause, problem: InverseProblem) -> float:
    """The declared or held value, in its unit."""
    if not c.parameter:
        return c.exact
    shot, held = problem.shot, problem.settings.held
    return held.get(c.parameter, PARAMETERS[c.parameter].held(shot))


def declared_sigma(c: Cause, runner: Runner) -> float:
    """Declared standard uncertainty plus the default allowance, in the value's unit; 0 without both."""
    declared = runner.problem.shot.uncertainty.get(c.declared, 0.0)
    return hypot(declared, c.allowance, runner.front.path.sigma_onset if c.onset else 0.0)


def declared_span(c: Cause, runner: Runner) -> tuple[float, float] | None:
    """Range of coordinates within k = 2 of the declared value; None if no uncertainty is declared."""
    middle, half = held_value(c, runner.problem), COVERAGE * declared_sigma(c, runner)
    if not (half > 0.0 and isfinite(half) and isfinite(middle)):
        return None
    ends = sorted(c.value(u) for u in (c.lowest, c.highest))
    low, high = (min(max(v, ends[0]), ends[1]) for v in (middle - half, middle + half))
    one, other = sorted((c.coordinate(low), c.coordinate(high)))
    return (one, other) if one < other else None


MOST_COMPRESSION = 0.8
"""Values with a larger nominal compression are not tried, because elements and time step would collapse."""


def leaves_length(runner: Runner, change: Change) -> bool:
    """True if the changed flyer motion does not crush the changed specimen."""
    motion, factor = change.motion * change.picture, change.specimen.get("length", 1.0)
    if motion <= factor:
        return True  # not more than declared
    path = runner.front.path
    travel = motion * float(np.max(path.position(path.knots)))
    length = factor * runner.problem.shot.specimen.length
    return travel < MOST_COMPRESSION * length


WITHOUT_TRACE = (
    "The scale of the quasi-static curve leaves no residual: the data show only m times the curve. A "
    "curve 5 % too low gives an m 5 % too high, and no data of the shot show it.",
)
"""Errors that no table of causes can show."""


def corrected(shot: Shot, settings: Settings, finding: CauseFinding) -> tuple[Shot, Settings] | None:
    """The shot and the settings with the found value; None if it cannot be set, as for a flyer's tilt."""
    for one in INPUTS.values():
        if one.cause is not None and one.cause.key == finding.key:
            if one.applied is not None:
                return one.applied(shot, finding.value), settings
            names = one.cause.changed(one.cause.coordinate(finding.value)).values
            held = {**settings.held, **dict.fromkeys(names, finding.value)}
            return (shot, replace(settings, held=held)) if names else None
    return None
