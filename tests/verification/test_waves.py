"""Waves and inertia: Pochhammer and Chree's guided waves, and the radial inertia of a disc."""

from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from order import assert_order, fitted_order
from scene import DENSITY, RADIUS, YOUNG, FloatArray, gentle_stroke, ninth, ninth_slope, shear_modulus
from scipy.interpolate import CubicSpline

from explicit import Model, PlatenMotion, Samples, Sampling, cylinder, run
from explicit.materials import neo_hookean

REFERENCE = Path(__file__).resolve().parent.parent / "reference" / "F_pochhammer_nu0.29.csv"
MESHES = ((6, 12), (12, 24), (24, 48))
MODES = (1, 2, 3)  # half waves along a rod of length 2 a; mode n has a / wavelength = n / 4
WAVE_TOLERANCE = 5e-3
"""Allowed relative error of a phase velocity on the finest mesh [-]: 0.34 % at 32 elements a wavelength."""

DISC_POISSON, DISC_STROKE, ASPECTS = 0.4999, 0.3, (10.0, 20.0, 40.0)
DURATIONS = (2e-4, 4e-4, 8e-4)
"""Duration of the disc's compression [s]; a pressure wave needs 12 µs for the radius."""
INERTIA_TOLERANCE = 5e-3
"""Allowed force error of the slowest disc over the largest force [-]: the closed form has no
compressibility, which leaves (radius / (c duration))^2, 1.4 % at 0.4 ms."""


Result = SimpleNamespace


def frequencies(signal: FloatArray, interval: float, order: int = 12) -> FloatArray:
    """Frequencies of the undamped sinusoids in a signal [Hz], ascending (ESPRIT: Roy and Kailath 1989)."""
    window = np.lib.stride_tricks.sliding_window_view(signal, len(signal) // 2).T
    basis = np.linalg.svd(window, full_matrices=False)[0][:, :order]
    poles = np.linalg.eigvals(np.linalg.lstsq(basis[:-1], basis[1:], rcond=None)[0])
    found = np.angle(poles[np.abs(np.abs(poles) - 1.0) < 2e-3]) / (2.0 * np.pi * interval)
    return np.sort(found[found > 1.0])


def _standing_waves(mesh: tuple[int, int]) -> FloatArray:
    """Phase velocities [m/s] of a rod between frictionless faces, after a small second compression."""
    poisson, length, size = 0.29, 2.0 * RADIUS, 1e-5
    slow, quick, listen = 8e-3, 1e-3, 1.2e-2
    end = slow + quick + listen
    # Compressed slowly first, so that the vibration does not lift the faces off the platens.
    first = gentle_stroke(12.0 * size * length, slow, end=end)
    s = (np.linspace(0.0, end, len(first.position)) - slow) / quick
    motion = PlatenMotion(
        start=0.0,
        step=first.step,
        position=first.position + size * length * ninth(s),
        velocity=first.velocity + size * length / quick * ninth_slope(s),
    )
    model = Model(
        cylinder(RADIUS, length, n_radial=mesh[0], n_axial=mesh[1]), DENSITY,
        (neo_hookean(shear_modulus(poisson)),), (motion,), faces="frictionless", side="frictionless",
    )  # fmt: skip
    times = np.linspace(slow + quick, end - 1e-4, 217)
    response = run(model, Samples.of(poisson=poisson), Sampling(times, times))
    bulge = (response.surface_r[0] - RADIUS) / (size * length)
    place = np.linspace(0.0, 1.0, mesh[1] + 1)
    weight = np.where((place == 0.0) | (place == 1.0), 0.5, 1.0)
    found = []
    for n in MODES:
        amplitude = (bulge * weight * np.cos(n * np.pi * place)).sum(axis=1)
        lowest = frequencies(amplitude, times[1] - times[0])
        lowest = lowest[lowest > 50.0][0]  # below: what is left of the static bulge
        found.append(lowest * 2.0 * length / n)
    return np.array(found)


def _disc(aspect: float, duration: float) -> tuple[FloatArray, ...]:
    """Times, force, closed form, static part and largest relative spread of the radius of a flat disc."""
    height, mu = RADIUS / aspect, shear_modulus(DISC_POISSON)
    model = Model(
        cylinder(RADIUS, height, n_radial=32, n_axial=2),
        DENSITY,
        (neo_hookean(mu),),
        (gentle_stroke(DISC_STROKE * height, duration, end=duration),),
        faces="frictionless",
        side="frictionless",
    )
    times = np.linspace(0.1, 0.52, 43) * duration  # while the platens are pressed
    response = run(model, Samples.of(poisson=DISC_POISSON), Sampling(times, times))
    s = times / duration
    stretch = 1.0 - DISC_STROKE * ninth(s)
    rate = DISC_STROKE / duration * ninth_slope(s)
    acceleration = DISC_STROKE / duration**2 * ninth_slope(s, 2)
    inertia = DENSITY * RADIUS**2 / 8.0 * (acceleration / stretch**2 + 1.5 * rate**2 / stretch**3)
    area = np.pi * RADIUS**2 / stretch
    static = mu * (1.0 / stretch - stretch**2) * area
    force = 0.5 * (response.force_flyer[0] + response.force_transmission[0])
    spread = np.ptp(response.surface_r[0], axis=-1).max() / RADIUS
    return times, force, inertia * area + static, static, spread


@cache
def case() -> Result:
    """Three meshes of the rod; three durations and three aspects of the disc."""
    slenderness = np.array(MODES) / 4.0
    data = np.loadtxt(REFERENCE, delimiter=",")
    exact = CubicSpline(data[:, 0], data[:, 1])(slenderness)
    velocity = np.array([_standing_waves(mesh) for mesh in MESHES]) / np.sqrt(YOUNG / DENSITY)
    sizes = [1.0 / n for _, n in MESHES]
    error = np.abs(velocity / exact - 1.0)
    discs = [_disc(20.0, duration) for duration in DURATIONS]
    disc_error = np.array([np.abs(force - closed).max() / closed.max() for _, force, closed, _, _ in discs])
    _, _, closed, static, _ = discs[-1]
    return Result(
        slenderness=slenderness,  # a / wavelength of the modes [-], shape [n_modes]
        # Phase velocity over sqrt(E / rho) found on each mesh [-], shape [n_meshes, n_modes].
        velocity=velocity,
        # Phase velocity of the first Pochhammer mode over sqrt(E / rho) [-], shape [n_modes].
        exact_velocity=exact,
        # fit of the higher modes' errors (n = 2, 3) against the element size
        wave_order=tuple(fitted_order(sizes, error[:, k]) for k in (1, 2)),
        # Of the slowest disc: inertia plus static stress, times the face [N], shape [n_times].
        closed_form=closed,
        static=static,  # the static part alone [N], shape [n_times]
        # largest force error over the largest force, by duration [-], shape [n_durations]
        disc_error=disc_error,
        disc_order=fitted_order(1.0 / np.array(DURATIONS), disc_error),  # its fit against 1 / duration
        # Largest spread of the side radius over the radius, by aspect a / h at 0.2 ms [-], shape [n_aspects].
        spread=np.array([_disc(aspect, DURATIONS[0])[4] for aspect in ASPECTS]),
    )


def wave_error(result: Result) -> FloatArray:
    """Relative error of the phase velocities [-], shape [n_meshes, n_modes]."""
    return result.velocity / result.exact_velocity - 1.0


def shown(result: Result) -> dict[str, object]:
    """What the page and the index show beside the fields of the result."""
    waves = [
        [f"{x:g}", f"{v:.4f}", *(f"{100 * e:+.2f}" for e in errors)]
        for x, v, errors in zip(result.slenderness, result.exact_velocity, wave_error(result).T, strict=True)
    ]
    discs = [[f"{1e3 * t:g}", f"{100 * e:.2f}"] for t, e in zip(DURATIONS, result.disc_error, strict=True)]
    flat = [[f"{a:g}", f"{100 * e:.4f}"] for a, e in zip(ASPECTS, result.spread, strict=True)]
    orders = " and ".join(f"{fit.order:.2f} +- {fit.standard_error:.2f}" for fit in result.wave_order)
    header = ["a / wavelength", "exact c / c_0", *(f"{n} × {m}, error [%]" for n, m in MESHES)]
    share = 100 * (1 - result.static / result.closed_form).max()
    return locals()


def test_phase_velocities_are_those_of_pochhammer_and_chree() -> None:
    assert np.abs(wave_error(case())[-1]).max() < WAVE_TOLERANCE


def test_phase_velocities_converge_with_second_order() -> None:
    sizes = [1.0 / n for _, n in MESHES]
    error = np.abs(wave_error(case()))
    for mode in (1, 2):  # n = 2 and 3; the error of n = 1 comes down to that of the fitted frequency
        assert_order(sizes, error[:, mode], 2.0, 0.1)


def test_force_of_a_flat_disc_is_its_radial_inertia() -> None:
    result = case()
    assert result.disc_error[-1] < INERTIA_TOLERANCE
    assert (1.0 - result.static / result.closed_form).max() > 0.7  # inertia, not the static stress


def test_a_disc_approaches_the_closed_form_with_duration_and_flatness() -> None:
    # (a / (c duration))^2, and faster while pressure waves are excited at all.
    assert_order(1.0 / np.array(DURATIONS), case().disc_error, 2.0, 0.2, at_least=True)
    # y-dependence of the pressure: (h / a)^2, and higher terms at the thickest.
    assert_order(1.0 / np.array(ASPECTS), case().spread, 2.0, 0.3, at_least=True)
