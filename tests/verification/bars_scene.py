"""Common parts of the bar cases: the apparatus of Mates et al. (2012), the shot open-01, filters."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

from explicit import Model, Samples
from explicit.bars import Apparatus, Joint, PulseShaper, Section

FloatArray = NDArray[np.float64]

RADIUS = 7.5e-3  # radius of bars, platens and transducers [m]
YOUNG, POISSON = 190e9, 0.29  # steel and transducers of the paper [Pa], [-]
STEEL, QUARTZ = 8048.0, 6594.0  # density of the steel and of the transducers there [kg/m^3]
SPEED = 5.5  # the paper's striker [m/s]
TRANSDUCER_LENGTH = 16e-3  # not in the paper; a usual ring of quartz with its housing [m]
SHAPER_MODULUS = 40e6
"""Shear modulus of the pulse shaper's rubber at 2000 1/s [Pa]: the one number that is chosen, so that the
flyer starts with the 2.7 m/s of the paper's mean strain rates."""


def part(length: float, *, density: float = STEEL, radius: float = RADIUS) -> Section:
    """A section of the paper's materials."""
    return Section(length, radius, YOUNG, density, POISSON)


PLATEN, BAR, STRIKER = part(5e-3), part(1.5), part(0.25)
TRANSDUCER = part(TRANSDUCER_LENGTH, density=QUARTZ)
STACK = (PLATEN, TRANSDUCER, PLATEN, BAR)  # what stands behind the specimen: the paper's Fig. 3.
SENSOR = PLATEN.length + 0.5 * TRANSDUCER.length
"""Depth of the transducer's mid-section behind the specimen [m]."""


def rubber_shaper() -> PulseShaper:
    """The paper's disc of rubber, 5.5 mm x 2.0 mm, as a neo-Hookean one that slides on the steel."""
    radius, height = 2.75e-3, 2e-3
    stretch = np.linspace(1.0, 0.2, 161)
    force = SHAPER_MODULUS * np.pi * radius**2 * (stretch**-2 - stretch)
    compression = height * (1.0 - stretch)
    return PulseShaper(compression, force, float((np.diff(force) / np.diff(compression)).max()))


def apparatus() -> Apparatus:
    """The paper's test from the striker on; flyer and support are a transducer and a platen each."""
    return Apparatus(
        striker=(STRIKER,), speed=SPEED, shaper=rubber_shaper(), incident=(BAR,),
        joint=Joint(strength=100.0, opening=20e-6), flyer=(TRANSDUCER, PLATEN), transmission=STACK,
    )  # fmt: skip


@cache
def open_01(mesh: tuple[int, int] = (16, 22)) -> tuple[Model, Samples]:
    """Model and parameters of the known-answer shot open-01."""
    from kolsky.inverse.problem import prepare_shot
    from kolsky.inverse.settings import Numerics
    from kolsky.shot.load import load_shot

    shot = load_shot(Path(__file__).resolve().parents[2] / "runs" / "open-01")
    model = prepare_shot(shot).forward.model(Numerics(mesh=mesh))
    return model, Samples.of(stiffness_factor=1.12, poisson=0.499, damping=25e-6)


def unbonded(model: Model) -> Model:
    """The same specimen that does not slip but may lift off, as the paper's."""
    return replace(model, faces="rough", side="rough")


def low_pass(signal: FloatArray, step: float, cutoff: float) -> FloatArray:
    """Butterworth of fourth order, forward and backward."""
    return np.asarray(sosfiltfilt(butter(4, cutoff, fs=1.0 / step, output="sos"), signal))
