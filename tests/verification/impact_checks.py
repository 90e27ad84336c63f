"""The one-dimensional impact by itself: closed forms of bars, shaper and joint, and two balances."""

from functools import cache

import numpy as np
from bars_scene import BAR, PLATEN, SPEED, STRIKER, TRANSDUCER, apparatus, part
from numpy.typing import NDArray
from order import FittedOrder, fitted_order

from explicit.bars import Apparatus, Joint, PulseShaper, find_events, integrate_test
from explicit.bars.lines import FlightHistory, SpecimenForce

FloatArray = NDArray[np.float64]

STEP = STRIKER.travel_time / 512
"""Time step of the closed forms [s]: a whole number of steps along the striker."""
STIFFNESS = 5e8
"""Linear pulse shaper [N/m]."""
SHAPER_STEPS = STRIKER.travel_time / np.array([64, 128, 256])
"""Time steps of its convergence [s]."""


def _bare(
    *, striker: float = STRIKER.radius, shaper: PulseShaper | None = None, joint: Joint | None = None
) -> Apparatus:
    return Apparatus(
        striker=(part(STRIKER.length, radius=striker),),
        speed=SPEED,
        shaper=shaper,
        incident=(BAR,),
        joint=joint or Joint(0.0),
        flyer=(TRANSDUCER, PLATEN),
        transmission=(PLATEN,),
    )


def lines(history: FlightHistory) -> tuple:
    """Every row of bars of a test."""
    return history.striker, history.incident, history.flyer, history.transmission


@cache
def equal_bars() -> FlightHistory:
    """Striker on a bar of the same section, face on face."""
    return integrate_test(_bare(), end=0.9e-3, step=STEP)


@cache
def staircase() -> tuple[FloatArray, FloatArray]:
    """Levels of the impact force of a thicker striker [N], found and closed form.

    F_k = v Z1 Z2 / (Z1 + Z2) ((Z1 - Z2) / (Z1 + Z2))^k during the k-th round trip of the striker.
    """
    history = integrate_test(_bare(striker=10e-3), end=0.45e-3, step=STEP)
    middle = (2 * np.arange(4) + 1) * 512
    z1, z2 = history.striker.sections[0].impedance, BAR.impedance
    exact = SPEED * z1 * z2 / (z1 + z2) * ((z1 - z2) / (z1 + z2)) ** np.arange(4)
    return history.shaper_force[middle], exact


@cache
def linear_shaper() -> tuple[FloatArray, FittedOrder]:
    """Largest error of the force through a linear shaper over Z v / 2 [-], by step, and its order.

    F(t) = Z v / 2 (1 - exp(-2 k t / Z)) between equal bars until the striker's rear answers.
    """
    shaper = PulseShaper(np.array([0.0, 1e-3]), np.array([0.0, 1e-3 * STIFFNESS]), STIFFNESS)
    errors = []
    for step in SHAPER_STEPS:
        history = integrate_test(_bare(shaper=shaper), end=1.9 * STRIKER.travel_time, step=float(step))
        # The first step sees the closing speed appear at once: the rule takes it as there from half of it on.
        time = history.times + 0.5 * step
        scale = 0.5 * BAR.impedance * SPEED
        exact = scale * (1.0 - np.exp(-2.0 * STIFFNESS * time / BAR.impedance))
        errors.append(np.abs(history.shaper_force - exact).max() / scale)
    return np.array(errors), fitted_order(SHAPER_STEPS, errors)


@cache
def free_flight() -> FlightHistory:
    """The paper's apparatus without a specimen."""
    return integrate_test(apparatus(), end=1.5e-3, step=PLATEN.travel_time / 9)


SPRING = 2e4
"""Stiffness of a specimen that is a spring [N/m]."""


@cache
def flight_on_a_spring() -> tuple[float, float]:
    """Time from separation to arrest, and largest force, over their closed forms [-].

    A rigid flyer of mass M that leaves at speed v with the spring compressed by x0 stands still after
    (pi / 2 - phi) / w with tan(phi) = w x0 / v and w^2 = k / M, under the force sqrt(k M v^2 + (k x0)^2).
    """
    step = PLATEN.travel_time / 9
    n = round(4e-3 / step) + 1
    curve = np.array([-1e-2, 1e-2])
    spring = SpecimenForce(curve, SPRING * curve, np.zeros(n), np.zeros(n))
    history = integrate_test(apparatus(), end=4e-3, step=step, specimen=spring)
    events, mass = find_events(history), PLATEN.mass + TRANSDUCER.mass
    apart, again = round(events.separation / step), round(events.second_impact / step)
    speed, start = history.flyer.momentum()[apart] / mass, history.compression[apart]
    omega = np.sqrt(SPRING / mass)
    swing = (0.5 * np.pi - np.arctan(omega * start / speed)) / omega
    largest = np.sqrt(SPRING * mass * speed**2 + (SPRING * start) ** 2)
    found = history.force_transmission[:again].max()
    return float((events.arrest - events.separation) / swing), float(found / largest)


def balances(history: FlightHistory) -> tuple[float, float, float]:
    """Drift of the momentum over the striker's, imbalance of the energy over the striker's, and the joint's
    work over strength x opening / 2 [-].
    """
    momentum = sum(line.momentum() for line in lines(history))
    energy = sum(line.energy() for line in lines(history))
    shaper = np.diff(history.shaper_approach) * 0.5 * (history.shaper_force[1:] + history.shaper_force[:-1])
    joint = np.diff(history.joint_gap) * -history.joint_force[1:]
    lost = np.concatenate([[0.0], np.cumsum(shaper + joint)])
    expected = 0.5 * apparatus().joint.strength * apparatus().joint.opening
    drift = np.abs(momentum / momentum[0] - 1.0).max()
    return float(drift), float(np.abs((energy + lost) / energy[0] - 1.0).max()), float(joint.sum() / expected)
