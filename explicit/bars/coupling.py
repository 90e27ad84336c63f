"""The specimen with the elastic parts around it, iterated to agreement.

`couple`: waveform iteration (Lelarasmee and others 1982), partitioned at the face of the transmission
platen: the
specimen on a support of known motion gives a force, the elastic parts under this force give a motion. The
parts
are stiffer than the specimen by four orders of magnitude, so a pass leaves about that share of the error.

`simulate_test`: the whole test with one-dimensional bars. The flyer flies free, so it is the specimen that
stops it,
and a plain waveform iteration would swing. Each pass therefore integrates the bars with a static curve of
the
specimen in the loop and with what that curve left out in the pass before; only the curve's error is
iterated.
"""

from dataclasses import dataclass, replace

import numpy as np

from explicit.arrays import FloatArray
from explicit.bars.elastic import ElasticBar, ElasticHistory
from explicit.bars.lines import Apparatus, FlightHistory, SpecimenForce, integrate_test
from explicit.model import Model, Samples, Sampling, Stepping
from explicit.platens import MovingSupport, PlatenMotion
from explicit.response import Response
from explicit.run_batch import run

_CONTACT_RADIUS_EVERY = 8
"""Knots of the flyer's motion from one contact radius to the next."""
ON_PLATEN = 1e-6
"""A side node this share of the specimen's length above the platen lies on it."""


@dataclass(frozen=True)
class Coupled:
    """A batch whose specimens and elastic parts agree on force and motion."""

    response: Response
    """The specimens at the knots of the flyer's motion, and at every eighth of them their surface."""
    support: MovingSupport
    """The motion of the transmission platen's face; `run` with it repeats the simulation at other times."""
    parts: tuple[ElasticHistory, ...]
    """What the elastic parts did, one for each sample."""
    change: FloatArray
    """Largest change of a transmitted force [N] from each pass of the specimens to the next,
    shape [n_passes - 1]."""


def contact_radius(response: Response, length: float) -> FloatArray:
    """Radius of the patch on the transmission platen [m], shape [n_samples, n_surface_times].

    It is that of the outermost node of the side surface that lies on the platen.
    """
    height = response.surface_y - response.surface_y[:, :, :1]
    return np.asarray(np.where(np.abs(height) <= ON_PLATEN * length, response.surface_r, 0.0).max(axis=2))


def couple(
    model: Model,
    samples: Samples,
    parts: ElasticBar,
    *,
    tolerance: float = 1e-3,
    max_passes: int = 6,
    stepping: Stepping | None = None,
    device: str = "cpu",
    threads: int | None = None,
) -> Coupled:
    """Simulate specimens on elastic parts.

    Parameters
    ----------
    model, samples
        As for `run`. The model's own support carries the first pass; a better guess saves at most one.
    parts : ElasticBar
        The parts behind the specimen. The force presses on its face evenly within the specimen's contact
        radius; a specimen wider than the face presses on all of it.
    tolerance : float
        Largest change of the transmitted force from one pass to the next that ends the iteration [N].
    max_passes : int
        Passes after which it is given up, at least 2.
    stepping, device, threads
        As for `run`.

    Raises
    ------
    ValueError
        If `tolerance` or `max_passes` is outside its range.
    RuntimeError
        If a simulation does not complete or the force still changes after `max_passes`.
    """
    if max_passes < 2 or not tolerance > 0.0:
        raise ValueError(f"need tolerance > 0 N and max_passes >= 2, got {tolerance} and {max_passes}")
    motion = model.motions[0]
    knots = motion.start + motion.step * np.arange(len(motion.position), dtype=np.float64)
    surface = np.unique(np.append(knots[::_CONTACT_RADIUS_EVERY], knots[-1]))
    sampling = Sampling(knots, surface, ledger_every=len(surface))
    face_radius = float(parts.mesh.nodes[parts.mesh.face, 0].max())
    change: list[float] = []
    before: FloatArray | None = None
    for _ in range(max_passes):
        response = run(model, samples, sampling, stepping=stepping, device=device, threads=threads)
        _require_completed(response)
        if before is not None:
            change.append(float(np.abs(response.force_transmission - before).max()))
            if change[-1] <= tolerance:
                break
        before = response.force_transmission
        radius = np.minimum(contact_radius(response, model.mesh.length), face_radius)
        histories = tuple(
            _elastic_response(parts, knots, impulse, np.interp(knots, surface, patch))
            for impulse, patch in zip(response.impulse_transmission, radius, strict=True)
        )
        support = MovingSupport(tuple(_support_motion(history, motion) for history in histories))
        model = replace(model, support=support)
    else:
        raise RuntimeError(
            f"the transmitted force still changes by {change[-1]:.3g} N after {max_passes} passes, "
            f"tolerance {tolerance:g} N: raise max_passes, or the parts are too soft for this iteration"
        )
    return Coupled(response, support, histories, np.array(change))


def _require_completed(response: Response) -> None:
    """Raise RuntimeError, with cause and cure, if a simulation of a batch did not reach its end."""
    for i, outcome in enumerate(response.outcomes):
        if not outcome.ok:
            raise RuntimeError(
                f"simulation {i} ended at {1e6 * response.end_times[i]:.1f} us: {outcome.cause}; "
                f"{outcome.cure}"
            )


def mean_force(times: FloatArray, impulse: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Force from the impulse, which does not alias: its means over the intervals, at their middles."""
    middle = 0.5 * (times[1:] + times[:-1])
    force = np.diff(impulse) / np.diff(times)
    grid = np.concatenate([times[:1], middle, times[-1:]])
    return grid, np.concatenate([force[:1], force, force[-1:]])


def _elastic_response(
    parts: ElasticBar, knots: FloatArray, impulse: FloatArray, radius: FloatArray
) -> ElasticHistory:
    times, force = mean_force(knots, impulse)
    return parts.integrate(times, force, np.interp(times, knots, radius))


def _support_motion(history: ElasticHistory, flyer: PlatenMotion) -> PlatenMotion:
    """The face's motion on the knots of the flyer's; into the parts is away from the specimen."""
    knots = np.linspace(history.times[0], history.times[-1], len(flyer.position))
    position = -history.face_motion(knots)
    return PlatenMotion(
        start=flyer.start,
        step=flyer.step,
        position=position - position[0],
        velocity=-history.face_motion(knots, 1),
    )


KNOT = 5e-7
"""Distance of the knots of the platens' motions [s]."""
_OUTLINE_EVERY = 50
"""Knots from one outline to the next."""


@dataclass(frozen=True)
class FlyerTest:
    """A test from the striker's impact on."""

    bars: FlightHistory
    """What the bars did."""
    response: Response
    """What the specimen did; its forces at the knots, its outline every 25 us."""
    change: FloatArray
    """Largest change of a force on the specimen's platens from each pass to the next [N],
    shape [n_passes]."""


def simulate_test(
    apparatus: Apparatus,
    model: Model,
    samples: Samples,
    static: tuple[FloatArray, FloatArray],
    *,
    end: float,
    step: float = 1e-7,
    tolerance: float = 0.02,
    max_passes: int = 20,
    stepping: Stepping | None = None,
) -> FlyerTest:
    """Simulate the whole test of one specimen.

    Parameters
    ----------
    apparatus
        The bars.
    model, samples
        The specimen and its parameters, one sample; motion and support of the model are replaced.
    static : tuple
        Compression [m] and force [N] of a rough static curve of the specimen, steep at its end. The result
        does not depend on it, the number of passes does.
    end : float
        Last time since the striker touched [s].
    step : float
        Time step of the bars [s].
    tolerance : float
        Largest change of a force from one pass to the next that ends the iteration [N].
    max_passes : int
        Passes after which it is given up.

    Raises
    ------
    ValueError
        If there is more than one sample.
    RuntimeError
        If a simulation does not complete or the forces still change after `max_passes`.
    """
    if len(samples) != 1:
        raise ValueError(f"a whole test is one sample, got {len(samples)}")
    n_knots = int(np.ceil(end / KNOT)) + 1
    knots = KNOT * np.arange(n_knots, dtype=np.float64)
    times = step * np.arange(round(end / step) + 1, dtype=np.float64)
    sampling = Sampling(knots, knots[::_OUTLINE_EVERY])
    excess = np.zeros((2, len(times)))
    change: list[float] = []
    for _ in range(max_passes):
        bars = integrate_test(apparatus, end=end, step=step, specimen=SpecimenForce(*static, *excess))
        flyer = _platen_motion(knots, times, bars.flyer_path, bars.flyer_velocity)
        support = _platen_motion(knots, times, -bars.support_path, -bars.support_velocity)
        moved = replace(model, motions=(flyer,), support=MovingSupport((support,)))
        response = run(moved, samples, sampling, stepping=stepping)
        _require_completed(response)
        used = np.array([bars.force_flyer, bars.force_transmission])
        found = np.array(
            [
                np.interp(times, *mean_force(knots, impulse[0]))
                for impulse in (response.impulse_flyer, response.impulse_transmission)
            ]
        )
        change.append(float(np.abs(found - used).max()))
        if change[-1] <= tolerance:
            return FlyerTest(bars, response, np.array(change))
        excess += found - used
    raise RuntimeError(
        f"the forces still change by {change[-1]:.3g} N after {max_passes} passes, tolerance "
        f"{tolerance:g} N: raise max_passes, or give a static curve closer to the specimen's"
    )


def _platen_motion(
    knots: FloatArray, times: FloatArray, path: FloatArray, velocity: FloatArray
) -> PlatenMotion:
    position = np.interp(knots, times, path)
    return PlatenMotion(
        start=0.0,
        step=float(knots[1]),
        position=position - position[0],
        velocity=np.interp(knots, times, velocity),
    )
