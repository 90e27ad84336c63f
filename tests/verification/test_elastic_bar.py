"""Elastic platens, transducer and bar behind the specimen, against one-dimensional waves."""

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from bars_scene import (
    BAR,
    PLATEN,
    POISSON,
    RADIUS,
    SENSOR,
    STACK,
    STEEL,
    TRANSDUCER,
    TRANSDUCER_LENGTH,
    YOUNG,
    low_pass,
    open_01,
    part,
)
from coupled_parts import contact_radius, couple
from matplotlib.figure import Figure
from order import FittedOrder, assert_order, fitted_order
from scene import FloatArray, label_sizes, rms, speed_after_rise
from scipy.interpolate import CubicSpline

from explicit import CharacteristicBar, Model, Samples, Sampling, cylinder, run
from explicit.bars import Section, elastic_bar, loaded_line, section_force
from explicit.bars.elastic import mesh_of, pressed_share
from explicit.materials import neo_hookean

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


FIGURE_SIZE = (6.7, 6.4)
SIZE, FINE = 2.5e-3, 1.25e-3  # elements of the parts, and those that show what the mesh leaves [m]
OTHER_LENGTHS = (8e-3, 24e-3)  # lengths of the transducer beside the assumed one [m]
LINE_STEP = 5e-8  # time step of the one-dimensional waves [s]
BANDS = {"raw": None, "20 kHz": 20e3, "5 kHz": 5e3}  # Low-pass filters of the comparison [Hz]
STATIC_TOLERANCE = 1e-13
"""Allowed nodal force beside the loads, over the force [-]: round-off of sums of some 20 terms."""
PHASE_TOLERANCE = 5e-3
"""Allowed error of the phase velocity with 8 elements across the radius [-]: second order, 0.4 % at 27
elements a wavelength."""
STEP_TOLERANCE = 1e-3
"""Allowed error of a transmitted or reflected impulse [-]: the field around a step of the radius holds some
of it back for a while."""
ENERGY_TOLERANCE = 1e-8
"""Allowed imbalance of the energy over the work [-]: central differences conserve it up to round-off."""
FORCE_LIMIT, SHARE_LIMIT = 0.3, 5e-3
"""Allowed difference of the transmitted force [N], and over its peak [-]: the uncertainty of the paper's
transducer, and what a stiffness of 1 % needs."""


@dataclass(frozen=True)
class Result:
    """Forces of open-01 on four kinds of support."""

    time: FloatArray  # times [s], shape [n]; the knots of the flyer's motion
    change: FloatArray  # largest change of the force between passes [N]
    face: FloatArray  # force on the face of the elastic parts [N], shape [n]
    face_difference: dict[str, FloatArray]
    """Force on the face on a simpler support less `face` [N], by support, shape [n]."""
    sensor: FloatArray  # force at the transducer's mid-section in the elastic parts [N], shape [n]
    sensor_difference: dict[str, FloatArray]
    """What a simpler model says less `sensor` [N], by model, shape [n]."""
    lengths: dict[float, float]
    """Largest difference of the force on the characteristic bar from that on elastic parts [N], by the
    transducer's length [m]."""
    travel: tuple[float, float]
    """Last place of the face in the elastic parts and on the characteristic bar [m]."""
    phase: tuple[FloatArray, FloatArray]  # phase velocities over c0 [-], closed form and found
    phase_order: FittedOrder  # fit of the error at the shortest wave
    steps: dict[str, tuple[FloatArray, FloatArray, float]]
    """Impulses at steps of the impedance: found, closed form; imbalance of the energy."""
    static: float  # nodal force beside the loads in uniform compression [-]
    imbalance: float  # imbalance of the energy of the elastic parts in open-01 [-]
    n_elements: int  # elements of the parts
    n_steps: int

    def bands(self, difference: FloatArray) -> dict[str, tuple[float, float]]:
        """Rms and largest value of a difference in every band [N]."""
        step = self.time[1] - self.time[0]
        found = {}
        for name, cutoff in BANDS.items():
            signal = difference if cutoff is None else low_pass(difference, step, cutoff)
            found[name] = (rms(signal), float(np.abs(signal).max()))
        return found


def _with_transducer(length: float) -> float:
    """Largest difference of the force on the characteristic bar from that on the parts [N]."""
    model, samples = open_01()
    stack = (PLATEN, replace(TRANSDUCER, length=length), PLATEN, BAR)
    coupled = couple(model, samples, elastic_bar(stack, size=SIZE))
    on_bar = run(replace(model, support=_bar(stack)), samples, _at(coupled.response.force_times))
    return float(np.abs(on_bar.force_transmission - coupled.response.force_transmission).max())


def _bar(stack: tuple[Section, ...]) -> CharacteristicBar:
    """A uniform bar as long as the parts."""
    length = sum(section.length for section in stack)
    return CharacteristicBar(impedance=BAR.impedance, round_trip=2.0 * length / BAR.wave_speed)


def _at(times: FloatArray) -> Sampling:
    return Sampling(times, times, ledger_every=len(times))


@cache
def case() -> Result:
    """Open-01 on elastic parts, on the characteristic bar and on a rigid support."""
    model, samples = open_01()
    parts = elastic_bar(STACK, size=SIZE, depths=[SENSOR])
    coupled = couple(model, samples, parts, tolerance=1e-5)
    history, knots = coupled.parts[0], coupled.response.force_times
    face = coupled.response.force_transmission[0]
    bar = _bar(STACK)
    rigid = run(model, samples, _at(knots))
    characteristic = run(replace(model, support=bar), samples, _at(knots))
    on_bar = characteristic.force_transmission[0]

    # The front's own force: what differs inside is then the model of the parts alone.
    grid = np.arange(0.0, history.times[-1] - history.times[0], LINE_STEP) + history.times[0]
    line = loaded_line(STACK, np.interp(grid, history.times, history.force), step=LINE_STEP)
    sensor = np.interp(knots, history.times, history.section_force[:, 0])
    radius = contact_radius(coupled.response, model.mesh.length)[0]
    patch = np.interp(history.times, coupled.response.surface_times, radius)
    fine = elastic_bar(STACK, size=FINE, depths=[SENSOR]).integrate(history.times, history.force, patch)
    delay = SENSOR / BAR.wave_speed
    return Result(
        time=knots,
        change=coupled.change,
        face=face,
        face_difference={
            "characteristic bar": on_bar - face,
            "rigid support": rigid.force_transmission[0] - face,
        },
        sensor=sensor,
        sensor_difference={
            "sections in one dimension": np.interp(knots, grid, line.force(SENSOR)) - sensor,
            "uniform bar, at its place": section_force(knots, on_bar, delay=delay, round_trip=bar.round_trip)
            - sensor,
            "uniform bar, at its front": on_bar - sensor,
            f"mesh of {1e3 * FINE:g} mm": np.interp(knots, fine.times, fine.section_force[:, 0]) - sensor,
        },
        lengths={length: _with_transducer(length) for length in OTHER_LENGTHS},
        travel=(-float(history.path[-1]), float(characteristic.surface_y[0, -1, 0])),
        phase=phase_velocities(),
        phase_order=phase_order(),
        steps={name: impedance_step(name) for name in STEPS},
        static=static_error(),
        imbalance=history.imbalance(),
        n_elements=len(parts.mesh.quads),
        n_steps=len(history.times) - 1,
    )


def draw(result: Result, figure: Figure) -> None:
    """Draw the figure of the page."""
    grid = figure.add_gridspec(3, 2, height_ratios=(1.1, 1.0, 0.8))
    waves, passes = figure.add_subplot(grid[0, 0]), figure.add_subplot(grid[0, 1])
    force, difference = figure.add_subplot(grid[1, :]), figure.add_subplot(grid[2, :])
    data = np.loadtxt(REFERENCE, delimiter=",")
    shown = data[data[:, 0] <= 0.35]
    waves.plot(shown[:, 0], shown[:, 1], "k-", linewidth=0.8, label="Pochhammer, Chree")
    for size, found, mark in zip(SIZES, result.phase[1], ("^", "s", "o"), strict=True):
        waves.plot(SLENDERNESS, found, mark, fillstyle="none", label=f"{1e3 * size:.2g} mm")
    waves.set(xlabel="a / wavelength [-]", ylabel="phase velocity / c₀ [-]")
    waves.legend()
    number = np.arange(len(result.change)) + 2
    passes.semilogy(number, result.change, "o-", color="C0")
    label_sizes(passes, number.astype(float))
    passes.set(xlabel="pass of the specimen [-]", ylabel="change of the force [N]")
    time, step = 1e3 * result.time, result.time[1] - result.time[0]
    force.plot(time, result.face, label="face")
    force.plot(time, result.sensor, linewidth=0.8, label="transducer's mid-section")
    force.set(ylabel="force [N]")
    force.legend(loc="upper left")
    for (name, values), color in zip(
        list(result.sensor_difference.items())[:3], ("C2", "C3", "0.6"), strict=True
    ):
        order = 1 if color == "0.6" else 3
        difference.plot(
            time, low_pass(values, step, 20e3), color=color, linewidth=0.9, label=name, zorder=order
        )
    difference.set(xlabel="time [ms]", ylabel="difference [N]")
    difference.set_ylim(-4.5, 4.5)
    difference.legend(loc="upper left", ncols=3)
    for axes in (force, difference):
        axes.set_xlim(0.0, time[-1])


def shown(result: Result) -> dict[str, object]:
    """What the page and the index show beside the fields of the result."""
    exact, found = result.phase
    phase = [
        [f"{x:g}", f"{c:.4f}", *(f"{100 * e:+.2f}" for e in errors)]
        for x, c, errors in zip(SLENDERNESS, exact, (found / exact - 1.0).T, strict=True)
    ]
    steps = [
        [name, *(f"{value:.4f}" for pair in zip(closed, seen, strict=True) for value in pair)]
        for name, (seen, closed, _) in result.steps.items()
    ]
    peak = result.face.max()
    rows = []
    for place, differences in (("face", result.face_difference), ("transducer", result.sensor_difference)):
        for name, values in differences.items():
            bands = result.bands(values)
            rows.append([place, name, *(f"{number:.2g}" for band in bands.values() for number in band)])
    header = ["force at", "model", *(f"{name}, {kind} [N]" for name in BANDS for kind in ("rms", "max"))]
    others = "; ".join(
        f"{error:.3f} N with a transducer of {1e3 * length:g} mm" for length, error in result.lengths.items()
    )
    changes = ", ".join(f"{change:.1e}" for change in result.change)
    worst = result.bands(result.face_difference["characteristic bar"])["raw"][1]
    return locals() | dict(POISSON=POISSON, STEEL=STEEL, TRANSDUCER_LENGTH=TRANSDUCER_LENGTH)


def test_uniform_compression_is_exact() -> None:
    assert static_error() < STATIC_TOLERANCE


def test_phase_velocities_are_those_of_pochhammer_and_chree() -> None:
    exact, found = phase_velocities()
    error = np.abs(found / exact - 1.0)
    assert error[-1].max() < PHASE_TOLERANCE
    assert_order(SIZES, error[:, 3], 2.0, 0.2)  # a / wavelength = 0.2; 0.2: three sizes
    assert 1.0 - exact[-1] > 20.0 * PHASE_TOLERANCE  # the mesh disperses as it must


@pytest.mark.parametrize("name", list(STEPS))
def test_impulse_at_a_step_of_the_impedance(name: str) -> None:
    found, exact, imbalance = impedance_step(name)
    np.testing.assert_allclose(found, exact, rtol=0, atol=STEP_TOLERANCE)
    assert imbalance < ENERGY_TOLERANCE


def test_loads_of_a_patch_are_consistent() -> None:
    """Total force and the first moment of an even pressure, closed form."""
    mesh = mesh_of([part(0.01)], size=1.5e-3)
    lines = mesh.nodes[mesh.face, 0]
    radius = np.array([1e-4, 1.5e-3, 4.75e-3, RADIUS])
    share = pressed_share(mesh, radius)
    np.testing.assert_allclose(share.sum(axis=1), 1.0, rtol=1e-12)  # round-off
    np.testing.assert_allclose(share @ lines, 2.0 * radius / 3.0, rtol=1e-12)  # mean of r over the patch


def test_what_cannot_be_is_refused() -> None:
    bar = elastic_bar([part(0.02)], size=2.5e-3)
    times = np.array([0.0, 1e-5])
    with pytest.raises(ValueError, match=r"pressed radius must be in \(0, 0.0075\] m, got 0.008"):
        bar.integrate(times, np.zeros(2), 8e-3)
    with pytest.raises(ValueError, match="finite at each of 2 times"):
        bar.integrate(times, np.array([0.0, np.nan]), RADIUS)
    with pytest.raises(ValueError, match=r"safety must be in \(0, 1\], got 1.5"):
        bar.integrate(times, np.zeros(2), RADIUS, safety=1.5)
    with pytest.raises(ValueError, match="must lie inside the parts, got depth 0"):
        elastic_bar([part(0.02)], size=2.5e-3, depths=[0.0])
    with pytest.raises(ValueError, match=r"depth must be in \[0, 0.02\] m, got 0.03"):
        elastic_bar([part(0.02)], size=2.5e-3, depths=[0.03])
    with pytest.raises(ValueError, match="at least one section"):
        elastic_bar([], size=2.5e-3)
    with pytest.raises(ValueError, match=r"poisson of a section must be in \(-1, 0.5\), got 0.5"):
        type(part(1.0))(1.0, 1.0, 1.0, 1.0, poisson=0.5)


def small_specimen(stroke: float) -> Model:
    motion = speed_after_rise(stroke / 0.4e-3, 50e-6, end=0.5e-3, n_knots=513)
    mesh = cylinder(4.75e-3, 6.5e-3, n_radial=4, n_axial=6)
    return Model(mesh, 870.0, (neo_hookean(27e3),), (motion,))


def test_a_batch_is_coupled_sample_by_sample() -> None:
    parts = elastic_bar([part(0.1)], size=3.75e-3)
    model = small_specimen(2e-3)
    both = couple(model, Samples.of(poisson=0.49, stiffness_factor=[0.8, 1.2]), parts)
    alone = couple(model, Samples.of(poisson=0.49, stiffness_factor=1.2), parts)
    assert len(both.parts) == 2
    difference = np.abs(both.response.force_transmission[1] - alone.response.force_transmission[0])
    assert difference.max() < 1e-3  # [N], the iteration's tolerance: it may end one pass apart
    # A short free bar is a rigid body for slow forces: its path is the integral of impulse over mass.
    times, impulse = alone.response.force_times, alone.response.impulse_transmission[0]
    path = np.trapezoid(impulse, times) / part(0.1).mass
    assert alone.parts[0].path[-1] == pytest.approx(path, rel=0.05)  # its waves: 41 us a round trip
