"""Dispersion of bar waves: the first mode, pulses against Fourier integrals, a bar of finite elements."""

from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from bar_pulses import Pulse, carried, exact_wavenumber, printed_equation
from bars_scene import POISSON, RADIUS, STEEL, YOUNG, part
from matplotlib.figure import Figure
from order import assert_order, fitted_order
from scene import FloatArray
from scipy.optimize import brentq

from explicit.bars import elastic_bar
from kolsky.bars.guides import waveguide
from kolsky.bars.guides.propagation import propagation
from kolsky.bars.guides.waveguide import ElasticWaveguide, rayleigh_speed
from kolsky.bars.records import Signal
from kolsky.base.apparatus import Bar

FIGURE_SIZE = (6.7, 6.2)
REFERENCE = Path(__file__).resolve().parent.parent / "reference" / "F_pochhammer_nu0.29.csv"
RATIOS = (0.1, 0.2, 0.29, 0.35, 0.45, 0.495)  # Poisson's ratios at which roots are compared
FREQUENCIES = (0.13, 0.57, 1.03, 1.83, 3.1, 6.2, 15.3)  # omega a / c0 there [-]
STEEL_BAR = Bar(2.0 * RADIUS, 2.0, YOUNG, STEEL, POISSON)
WAYS = (0.25, 0.5, 1.0, 2.0)  # ways of the pulse [m]
PULSE = Pulse(60e-6)
STEP, SAMPLES = 1e-7, 9000
"""Sampling of the pulse [s], and its length: until waves at the smallest group velocity have passed."""
SIZES = np.array([2.5e-3, 1.25e-3, 0.625e-3])  # elements of the bar [m]: 3, 6 and 12 across the radius
NEAR, FAR, LENGTH = 0.3, 0.8, 1.2  # Cross-sections of the finite-element bar and its length [m]
LOAD = Pulse(15e-6, duration=60e-6)
UNTIL = 320e-6  # before the echo of the far end reaches the second cross-section [s]
ROOT_TOLERANCE = 1e-8
"""Allowed relative error of a wavenumber or phase velocity [-]; the tables are made for 1e-9."""
PULSE_TOLERANCE = 2e-3  # allowed error of a pulse over its peak [-]: what the correction of a test needs
ORDER_TOLERANCE = 0.25
"""Allowed distance of the finite-element bar's order from 2: three sizes, the coarsest with 14 elements in
the shortest wave of the pulse."""


Result = SimpleNamespace


def _roots() -> FloatArray:
    errors = np.zeros((len(RATIOS), len(FREQUENCIES)))
    for i, nu in enumerate(RATIOS):
        for j, w in enumerate(FREQUENCIES):
            ours = float(waveguide.wavenumber(w, nu))
            span = (1.0 - 1e-5) * ours, (1.0 + 1e-5) * ours
            exact = brentq(lambda k, w=w, nu=nu: printed_equation(k, w, nu).real, *span, xtol=1e-14)
            errors[i, j] = abs(ours / exact - 1.0)
    return errors


def _element_bar(size: float) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """A pulse on the end of a finite-element bar, at two cross-sections."""
    bar = elastic_bar([part(LENGTH)], size=size, depths=[NEAR, FAR])
    times = np.arange(0.0, UNTIL, 1e-7)
    load = carried(LOAD, times, LOAD.frequencies(2.0 * UNTIL))
    history = bar.integrate(times, load, RADIUS)
    step = float(history.times[1] - history.times[0])
    near = Signal(float(history.times[0]), step, history.section_force[:, 0], 0.0, "N")
    way, n = bar.depths[1] - bar.depths[0], history.times.size
    there = [
        propagation(
            near, ElasticWaveguide(STEEL_BAR, dispersive=disperses), way, start=0.0, samples=n
        ).signal.value
        for disperses in (True, False)
    ]
    return history.times, history.section_force[:, 1], *there


def _speeds(reference: FloatArray) -> FloatArray:
    """c / c0 at the ratios of a table: a step of Newton's method from its own speeds, shape [n]."""
    k, h = 2.0 * np.pi * reference[:, 0], 1e-6
    w = k * reference[:, 1]
    slope = (waveguide.wavenumber(w + h, POISSON) - waveguide.wavenumber(w - h, POISSON)) / (2.0 * h)
    w = w + (k - waveguide.wavenumber(w, POISSON)) / slope
    return np.where(k > 0.0, w / np.where(k > 0.0, k, 1.0), 1.0)


@cache
def case() -> Result:
    """Roots, pulses and the finite-element bar."""
    data = np.loadtxt(REFERENCE, delimiter=",")[:, :2]
    found = _speeds(data)
    guide, c = ElasticWaveguide(STEEL_BAR), STEEL_BAR.wave_speed
    time = STEP * np.arange(SAMPLES)
    omega = PULSE.frequencies(2.0 * time[-1])
    k = exact_wavenumber(omega, radius=RADIUS, speed=c, poisson=POISSON)
    here = carried(PULSE, time, omega)
    forward, back, shift, pulses = [], [], [], {}
    for way in WAYS:
        there = carried(PULSE, time + way / c, omega, np.exp(-1j * k * way))
        sent = propagation(Signal(0.0, STEP, here, 0.0, "1"), guide, way).signal.value
        returned = propagation(Signal(way / c, STEP, there, 0.0, "1"), guide, -way).signal.value
        peak = np.abs(here).max()
        forward.append(np.abs(sent - there).max() / peak)
        back.append(np.abs(returned - here).max() / peak)
        shift.append(np.abs(here - there).max() / peak)
        pulses[way] = (time, there, returned)
    element = {float(size): _element_bar(float(size)) for size in SIZES}
    peak = np.abs(element[SIZES[-1]][1]).max()
    error = np.array([np.abs(sent - second).max() / peak for _, second, sent, _ in element.values()])
    _, second, _, plain = element[SIZES[-1]]
    return Result(
        reference=data,  # a / wavelength and c / c0 of the reference table, shape [n, 2]
        reference_error=float(np.abs(found - data[:, 1]).max()),  # largest difference from it [-]
        roots=_roots(),  # relative error of the wavenumber [-], shape [n_ratios, n_frequencies]
        # largest error of the pulse sent along a way, over its peak [-], shape [n_ways]
        forward=np.array(forward),
        back=np.array(back),  # the same for the pulse that has come along it, sent back [-], shape [n_ways]
        shift=np.array(shift),  # the same for a plain shift [-], shape [n_ways]
        pulses=pulses,  # Time after arrival [s], Fourier integral and recovered start [-], by the way [m].
        # By element size [m]: times [s], force at the second section, carried there from the first, and a
        # plain shift [N].
        element=element,
        element_error=error,  # largest difference of the carried force over the peak [-], by size
        # the same for a plain shift on the finest mesh [-]
        element_shift=float(np.abs(plain - second).max() / peak),
        order=fitted_order(SIZES, error),  # fit of `element_error` against the size
    )


def draw(result: Result, figure: Figure) -> None:
    """Draw the figure of the page."""
    grid = figure.add_gridspec(3, 2, height_ratios=(1.25, 1.0, 0.8))
    mode, pulse = figure.add_subplot(grid[0, 0]), figure.add_subplot(grid[0, 1])
    force = figure.add_subplot(grid[1, :])
    difference = figure.add_subplot(grid[2, :], sharex=force)
    frequency = np.linspace(1e-3, 5.5, 400)
    for nu in (0.1, 0.2, 0.29, 0.4, 0.49):
        k = waveguide.wavenumber(frequency, nu)
        (line,) = mode.plot(k / (2.0 * np.pi), frequency / k, label=f"ν = {nu:g}")
        mode.axhline(rayleigh_speed(nu), color=line.get_color(), linestyle=":", linewidth=0.6)
    shown = result.reference[(result.reference[:, 0] <= 1.2)][::3]
    mode.plot(shown[:, 0], shown[:, 1], "ko", markersize=2.5, markerfacecolor="none", markeredgewidth=0.6)
    mode.set(xlabel="a / wavelength [-]", ylabel="phase velocity c / c$_0$ [-]", xlim=(0.0, 1.2))
    mode.legend()

    time, start, _ = result.pulses[WAYS[0]]
    start = carried(PULSE, time, PULSE.frequencies(2.0 * time[-1]))
    pulse.plot(1e6 * time, start, "k-", linewidth=0.8, label="start")
    for way in (0.5, 2.0):
        pulse.plot(1e6 * time, result.pulses[way][1], label=f"after {way:g} m")
    pulse.plot(
        1e6 * time[::25], result.pulses[2.0][2][::25], "o", color="#009E73", markersize=2, label="recovered"
    )
    pulse.set(xlabel="time after arrival at c$_0$ [µs]", ylabel="strain over its plateau [-]", xlim=(30, 260))
    pulse.legend(loc="upper right")

    finest = float(SIZES[-1])
    times, second, sent, plain = result.element[finest]
    force.plot(1e6 * times, plain, ":", color="#777777", label="shifted by c$_0$")
    force.plot(1e6 * times, second, "k-", linewidth=0.9, label="finite elements, 0.8 m")
    force.plot(1e6 * times, sent, "--", color="#D55E00", label="carried from 0.3 m")
    force.set(ylabel="force over load [-]", xlim=(150.0, 1e6 * UNTIL))
    force.tick_params(labelbottom=False)
    force.legend(loc="upper right")
    for size, (times, second, sent, _) in result.element.items():
        difference.plot(1e6 * times, 100.0 * (sent - second), label=f"{1e3 * size:g} mm")
    difference.set(xlabel="time [µs]", ylabel="difference [% of load]", ylim=(-2.6, 3.6))
    difference.legend(loc="upper right", ncols=3)


def shown(result: Result) -> dict[str, object]:
    """What the page and the index show beside the fields of the result."""
    roots = [
        [f"{nu:g}", *(f"{error:.0e}" for error in errors)]
        for nu, errors in zip(RATIOS, result.roots, strict=True)
    ]
    pulses = [
        [f"{way:g}", f"{100 * sent:.1e}", f"{100 * returned:.1e}", f"{100 * shifted:.1f}"]
        for way, sent, returned, shifted in zip(WAYS, result.forward, result.back, result.shift, strict=True)
    ]
    sizes = [
        [f"{1e3 * size:g}", f"{RADIUS / size:.0f}", f"{100 * error:.3f}"]
        for size, error in zip(SIZES, result.element_error, strict=True)
    ]
    return locals()


pytestmark = pytest.mark.slow  # a finite-element bar of 44 000 elements


def test_roots_of_the_frequency_equation_and_pulses_carried_by_them() -> None:
    result = case()
    assert result.roots.max() < ROOT_TOLERANCE
    assert result.reference_error < ROOT_TOLERANCE
    assert result.forward.max() < PULSE_TOLERANCE
    assert result.back.max() < PULSE_TOLERANCE
    assert result.shift.min() > 20.0 * PULSE_TOLERANCE  # there is something to correct


def test_a_finite_element_bar_disperses_alike() -> None:
    result = case()
    assert result.element_error[-1] < PULSE_TOLERANCE
    assert result.element_shift > 20.0 * PULSE_TOLERANCE
    assert_order(SIZES, result.element_error, 2.0, ORDER_TOLERANCE)
