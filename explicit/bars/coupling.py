"""The whole test with one-dimensional bars and a specimen between them, iterated to convergence.

The specimen stops the free flyer, so a plain waveform iteration (Lelarasmee and others 1982) would oscillate.
Each pass therefore integrates the bars together with a static curve of the specimen. It adds the difference
of the force from this curve in the previous pass. Only the error of the curve is iterated.
"""

from dataclasses import dataclass, replace

import numpy as np

from explicit.arrays import FloatArray
from explicit.bars.lines import Apparatus, FlightHistory, SpecimenForce, integrate_test
from explicit.model import Model, Samples, Sampling, Stepping
from explicit.platens import MovingSupport, PlatenMotion
from explicit.response import Response
from explicit.run_batch import run

KNOT = 5e-7
"""Distance of the knots of the platens' motions [s]."""
_OUTLINE_EVERY = 50
"""Number of knots from one outline to the next."""


@dataclass(frozen=True)
class FlyerTest:
    """Result of a test, from the striker's impact on."""

    bars: FlightHistory
    """Motion and forces of the bars."""
    response: Response
    """Response of the specimen: forces at the knots, outline every 25 us."""
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
        The specimen and its parameters, one sample. Motion and support of the model are replaced.
    static : tuple
        Compression [m] and force [N] of a rough static curve of the specimen, steep at its end. It affects
        the number of passes, but not the result.
    end : float
        Last time, measured from the striker's impact [s].
    step : float
        Time step of the bars [s].
    tolerance : float
        The iteration ends if the largest change of a force from one pass to the next is below this [N].
    max_passes : int
        Largest number of passes.

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
        with_motion = replace(model, motions=(flyer,), support=MovingSupport((support,)))
        response = run(with_motion, samples, sampling, stepping=stepping)
        response.require_completed()
        used = np.array([bars.force_flyer, bars.force_transmission])
        settled = np.array(
            [
                np.interp(times, *mean_force(knots, impulse[0]))
                for impulse in (response.impulse_flyer, response.impulse_transmission)
            ]
        )
        change.append(float(np.abs(settled - used).max()))
        if change[-1] <= tolerance:
            return FlyerTest(bars, response, np.array(change))
        excess += settled - used
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


def mean_force(times: FloatArray, impulse: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Force from the impulse: means over the intervals, at their middles. Unlike samples of the force, these
    means have no aliasing.
    """
    middle = 0.5 * (times[1:] + times[:-1])
    force = np.diff(impulse) / np.diff(times)
    grid = np.concatenate([times[:1], middle, times[-1:]])
    return grid, np.concatenate([force[:1], force, force[-1:]])
