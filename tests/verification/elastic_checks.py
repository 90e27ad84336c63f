"""The mesh of elastic parts by itself: static compression, guided waves, steps of the impedance, energy."""

from functools import cache
from pathlib import Path

import numpy as np
from bars_scene import RADIUS, YOUNG, part
from numpy.typing import NDArray
from order import FittedOrder, fitted_order
from scipy.interpolate import CubicSpline

from explicit.bars import elastic_bar
from explicit.bars.elastic import pressed_share

FloatArray = NDArray[np.float64]

REFERENCE = Path(__file__).resolve().parent.parent / "reference" / "F_pochhammer_nu0.29.csv"
SIZES = np.array([3.75e-3, 1.875e-3, 0.9375e-3])
"""Elements of the guided waves [m]: 2, 4 and 8 across the radius."""
SLENDERNESS = np.array([0.05, 0.1, 0.15, 0.2, 0.25, 0.3])
"""a / wavelength at which the phase velocity is compared [-]; the second mode begins above."""
STEPS = {
    "steel on transducer": (part(0.5), part(0.5, density=6594.0)),
    "Ø 15 mm on Ø 10 mm": (part(0.5), part(0.5, radius=5e-3)),
    "Ø 10 mm on Ø 15 mm": (part(0.5, radius=5e-3), part(0.5)),
}


def static_error() -> float:
    """Uniform compression: largest nodal force beside the loads on both faces, over the force [-].

    Closed form: u_x = F (L - x) / (E A), u_r = nu r F / (E A).
    """
    rod = part(0.02)
    bar = elastic_bar([rod], size=1.5e-3)
    r, x = bar.mesh.nodes.T
    strain = 1e-6
    u = np.column_stack([rod.poisson * strain * r, strain * (rod.length - x)]).ravel()
    force = YOUNG * rod.area * strain
    load = np.zeros(2 * bar.mesh.n_nodes)
    load[2 * bar.mesh.face + 1] = pressed_share(bar.mesh, np.array([RADIUS]))[0]
    load[2 * bar.mesh.plane(rod.length) + 1] = -load[2 * bar.mesh.face + 1]
    return float(np.abs(bar.stiffness @ u / force - load).max())


@cache
def phase_velocities() -> tuple[FloatArray, FloatArray]:
    """Phase velocity over c0 [-] at `SLENDERNESS`, closed form shape [n] and found [n_sizes, n]."""
    data = np.loadtxt(REFERENCE, delimiter=",")
    exact = CubicSpline(data[:, 0], data[:, 1])(SLENDERNESS)
    frequency = CubicSpline(data[:, 0], data[:, 3])(SLENDERNESS)
    rod, near, far = part(0.6), 0.15, 0.3
    found = []
    for size in SIZES:
        bar = elastic_bar([rod], size=size, depths=[near, far])
        times = np.linspace(0.0, 175e-6, 1751)  # until the far end's echo
        pulse = np.exp(-0.5 * ((times - 15e-6) / 2.5e-6) ** 2)
        history = bar.integrate(times, pulse, RADIUS)
        # Signals fade out before the end of the record; the transform is evaluated at the frequencies wanted.
        wave = np.exp(-2j * np.pi * frequency[:, None] * history.times) @ history.section_force
        turns = np.angle(wave[:, 0] / wave[:, 1]) / (2.0 * np.pi)
        delay = (bar.depths[1] - bar.depths[0]) * frequency / (exact * rod.wave_speed)
        turns += np.round(delay - turns)  # the nearest whole number of turns
        found.append((bar.depths[1] - bar.depths[0]) * frequency / turns / rod.wave_speed)
    return exact, np.array(found)


def phase_order() -> FittedOrder:
    """Fit of the error at the shortest wave against the element size."""
    exact, found = phase_velocities()
    return fitted_order(SIZES, np.abs(found[:, -1] / exact[-1] - 1.0))


@cache
def impedance_step(name: str) -> tuple[FloatArray, FloatArray, float]:
    """Transmitted and reflected share of an impulse [-], found and closed form, and the energy's imbalance.

    Shares 2 Z2 / (Z1 + Z2) and (Z2 - Z1) / (Z1 + Z2) of the incident impulse: the long-wave limit, which an
    impulse is.
    """
    first, second = STEPS[name]
    bar = elastic_bar([first, second], size=2.5e-3, depths=[0.25, 0.75])
    duration, c = 60e-6, first.wave_speed
    end = (first.length + second.length + 0.25) / max(c, second.wave_speed)
    times = np.linspace(0.0, end, 2001)
    pulse = np.where(times < duration, np.sin(np.pi * times / duration) ** 2, 0.0)
    history = bar.integrate(times, pulse, first.radius)
    step = history.times[1]
    incident = history.times < 0.5 * ((0.25 / c + duration) + 0.75 / c)
    impulse = history.section_force * step
    found = np.array([impulse[:, 1].sum(), impulse[~incident, 0].sum()]) / impulse[incident, 0].sum()
    z1, z2 = first.impedance, second.impedance
    return found, np.array([2.0 * z2, z2 - z1]) / (z1 + z2), history.imbalance()
