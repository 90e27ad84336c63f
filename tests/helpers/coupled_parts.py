"""Specimens on elastic parts with time integration: waveform iteration (Lelarasmee and others 1982).

The specimen on a support of known motion gives a force. The elastic parts under this force give a motion. The
parts are stiffer than the specimen by four orders of magnitude, so a pass reduces the error by about this
factor. It is the reference for the pulses of `explicit.bars.elastic`.
"""

from dataclasses import dataclass, replace

import numpy as np

from explicit import MovingSupport, PlatenMotion, Response, Samples, Sampling, run
from explicit.arrays import FloatArray
from explicit.bars.coupling import mean_force
from explicit.bars.elastic import ElasticBar, ElasticHistory
from explicit.model import Model

_CONTACT_RADIUS_EVERY = 8  # number of knots of the flyer's motion from one contact radius to the next
ON_PLATEN = 1e-6
"""A side node lies on the platen if its height is at most this share of the specimen's length."""


@dataclass(frozen=True)
class Coupled:
    """A batch with consistent forces and motions of specimens and elastic parts."""

    response: Response
    """The specimens at the knots of the flyer's motion. Their surface is recorded at every eighth knot."""
    support: MovingSupport
    """The motion of the transmission platen's face. `run` with this motion repeats the simulation at other
    times."""
    parts: tuple[ElasticHistory, ...]  # response of the elastic parts, one for each sample
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
    threads: int | None = None,
) -> Coupled:
    """Simulate specimens on elastic parts.

    The first pass uses the support of the model; a better guess saves at most one pass. The force presses
    evenly on the bar's face within the specimen's contact radius. A wider specimen presses on the whole face.
    ``tolerance``: largest change of the transmitted force from one pass to the next that ends the iteration
    [N].
    """
    motion = model.motions[0]
    knots = motion.start + motion.step * np.arange(len(motion.position), dtype=np.float64)
    surface = np.unique(np.append(knots[::_CONTACT_RADIUS_EVERY], knots[-1]))
    sampling = Sampling(knots, surface, ledger_every=len(surface))
    face_radius = float(parts.mesh.nodes[parts.mesh.face, 0].max())
    change: list[float] = []
    before: FloatArray | None = None
    for _ in range(max_passes):
        response = run(model, samples, sampling, threads=threads)
        response.require_completed()
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
        raise RuntimeError(f"the transmitted force still changes by {change[-1]:.3g} N")
    return Coupled(response, support, histories, np.array(change))


def _elastic_response(
    parts: ElasticBar, knots: FloatArray, impulse: FloatArray, radius: FloatArray
) -> ElasticHistory:
    times, force = mean_force(knots, impulse)
    return parts.integrate(times, force, np.interp(times, knots, radius))


def _support_motion(history: ElasticHistory, flyer: PlatenMotion) -> PlatenMotion:
    """The face's motion at the knots of the flyer's motion. Into the parts is away from the specimen."""
    knots = np.linspace(history.times[0], history.times[-1], len(flyer.position))
    position = -history.face_motion(knots)
    return PlatenMotion(
        start=flyer.start,
        step=flyer.step,
        position=position - position[0],
        velocity=-history.face_motion(knots, 1),
    )
