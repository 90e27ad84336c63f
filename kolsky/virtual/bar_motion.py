"""The flyer's motion in the whole test, from the striker's impact on: the apparatus of Mates et al. (2012).

One-dimensional waves in striker, incident bar and flyer, a rubber pulse shaper, a joint that lets the
flyer go, and a specimen that stops it: `explicit.bars`. The specimen is a static curve here, which is enough
for a motion; the motion is then prescribed to the finite elements.
"""

from functools import lru_cache

import numpy as np

from explicit.bars import Apparatus, Joint, PulseShaper, Section
from explicit.bars.impact import SpecimenForce, integrate_test
from kolsky.base.arrays import FloatArray

RADIUS = 7.5e-3
"""Radius of striker and bars [m]."""
YOUNG, STEEL = 190e9, 8048.0
"""Maraging steel [Pa], [kg/m^3]."""
BAR_LENGTH = 1.5
"""Of the incident and of the transmission bar [m]."""
SHAPER = (2.75e-3, 2e-3, 40e6)
"""Radius and height [m] and shear modulus [Pa] of the rubber disc, as in the verification of the impact."""
JOINT = (100.0, 20e-6)
"""Strength [N] and opening [m] of the adhesive."""
STEP = 1e-7
"""Time step of the bars [s]."""
MOVES = 1e-9
"""Displacement at which the flyer has started [m]."""
EVERY = 5
"""Steps from one sample of the motion to the next."""


@lru_cache(maxsize=64)
def flyer_samples(
    *,
    speed: float,
    striker_length: float,
    flyer: tuple[float, float, float],
    specimen: tuple[float, float, float],
    duration: float,
) -> tuple[FloatArray, FloatArray]:
    """Time since the flyer's start [s] and its displacement toward the specimen [m], shape [n] each.

    Parameters
    ----------
    speed
        Of the striker [m/s].
    striker_length
        [m]
    flyer
        Mass [kg], diameter [m] and length [m] of platen and transducer together.
    specimen
        Diameter [m], length [m] and dynamic shear modulus [Pa].
    duration
        Time after the start [s].
    """
    mass, diameter, length = flyer
    area = np.pi * diameter**2 / 4.0
    body = Section(length, 0.5 * diameter, YOUNG, mass / (area * length))
    bar = Section(BAR_LENGTH, RADIUS, YOUNG, STEEL)
    apparatus = Apparatus(
        striker=(Section(striker_length, RADIUS, YOUNG, STEEL),),
        speed=speed,
        shaper=_shaper(),
        incident=(bar,),
        joint=Joint(*JOINT),
        flyer=(body,),
        transmission=(bar,),
    )
    end = duration + 2.0 * BAR_LENGTH / bar.wave_speed
    n = round(end / STEP) + 1
    resisting = SpecimenForce(*static_curve(*specimen), np.zeros(n), np.zeros(n))
    history = integrate_test(apparatus, end=end, step=STEP, specimen=resisting)
    started = int(np.argmax(history.flyer_path > MOVES))
    keep = slice(max(started - 1, 0), None, EVERY)
    time, path = history.times[keep], history.flyer_path[keep]
    return time - time[0], path - path[0]


def static_curve(diameter: float, length: float, modulus: float) -> tuple[FloatArray, FloatArray]:
    """Compression [m] and force [N] of a bonded neo-Hookean cylinder, roughly: stiffer as it gets flat."""
    stretch = np.linspace(1.0, 0.04, 300)
    area = np.pi * diameter**2 / 4.0
    flat = 1.0 + 0.5 * (0.25 * diameter / length) ** 2 / stretch**3
    return length * (1.0 - stretch), modulus * area * (stretch**-2 - stretch) * flat


def _shaper() -> PulseShaper:
    """A disc of rubber that slides on the steel."""
    radius, height, modulus = SHAPER
    stretch = np.linspace(1.0, 0.2, 161)
    force = modulus * np.pi * radius**2 * (stretch**-2 - stretch)
    compression = height * (1.0 - stretch)
    return PulseShaper(compression, force, float((np.diff(force) / np.diff(compression)).max()))
