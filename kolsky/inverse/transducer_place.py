"""The transmitted force where its transducer sits: behind the face, on a bar that moves.

A transducer at the depth x of a uniform bar shows the force at the face, later by d = x / c_0, plus the
inertia of what lies before it, which the bar's own echoes accelerate (`explicit.bars.lines.section_force`).
The same holds for the impulse: a delay and a sum commute with the integral.
"""

from dataclasses import replace

import numpy as np

from explicit import Response
from explicit.bars import section_force
from kolsky.base.arrays import FloatArray
from kolsky.shot.records import ShotBase


def at_transducer(shot: ShotBase, response: Response) -> Response:
    """A batch with the transmitted force and impulse at the transducer in place of the platen's face.

    Parameters
    ----------
    shot
        The shot; a transducer at the face, or on a rigid support, leaves the batch as it is.
    response
        Simulations of it from rest on, with force times as dense as the force changes.
    """
    bar = shot.transmission_bar
    if shot.transducer_depth == 0.0 or bar is None:
        return response
    delay = shot.transducer_depth / bar.wave_speed

    def seen(history: FloatArray) -> FloatArray:
        times = response.force_times
        return np.stack(
            [section_force(times, row, delay=delay, round_trip=bar.round_trip) for row in history]
        )

    return replace(
        response,
        force_transmission=seen(response.force_transmission),
        impulse_transmission=seen(response.impulse_transmission),
    )
