"""Inertia against momentum, energy and travelling waves."""

import numpy as np
import pytest

from kolsky.bars.records import History, Quantity
from kolsky.bars.reduction.inertia import (
    axial_stress,
    compensate_mass,
    correct_axial_inertia,
    correct_radial_inertia,
    radial_pressure,
)
from kolsky.base.apparatus import Bar, Specimen

SPECIMEN = Specimen(diameter=9.5e-3, length=6.5e-3, density=870.0)
BAR = Bar(diameter=15e-3, length=1.5, youngs_modulus=190e9, density=8048.0)
T = np.linspace(0.0, 1e-3, 4001)


def compression(t):
    """e, e', e'' of a smooth ramp to 60 %."""
    w = np.pi / 1e-3
    return 0.3 * (1 - np.cos(w * t)), 0.3 * w * np.sin(w * t), 0.3 * w**2 * np.cos(w * t)


def test_radial_pressure_does_the_work_of_the_radial_kinetic_energy():
    """Power of the mean pressure on the moving face = rate of change of the radial kinetic energy."""
    e, e1, e2 = compression(T)
    rho, a0, L = SPECIMEN.density, SPECIMEN.radius, SPECIMEN.length
    mass, area = rho * np.pi * a0**2 * L, np.pi * a0**2 / (1 - e)
    # v_r = r D / 2 with D = e' / (1 - e); the mean of r^2 over the disc is a^2 / 2.
    energy = 0.5 * mass * (a0**2 / (1 - e) / 2) * (e1 / (1 - e) / 2) ** 2
    power = radial_pressure(e, e1, e2, density=rho, radius=a0) * area * e1 * L
    rate = np.gradient(energy, T)
    inner = slice(2, -2)
    # Second-order differences of a cosine over 4000 steps: (w h)^2 / 6 ~ 1e-7 of the largest, and round-off.
    np.testing.assert_allclose(power[inner], rate[inner], atol=1e-5 * np.abs(rate).max())


def test_radial_pressure_at_the_start_is_kolskys_term():
    p = radial_pressure(0.0, 0.0, 1e7, density=870.0, radius=4.75e-3)
    assert p == pytest.approx(870.0 * 4.75e-3**2 / 8 * 1e7)
    with pytest.raises(ValueError, match="must be < 1"):
        radial_pressure(1.0, 0.0, 0.0, density=870.0, radius=4.75e-3)


def test_radial_correction_takes_the_pressure_on_the_grown_face_off_the_nominal_stress():
    e, e1, e2 = compression(T)
    zero = np.zeros_like(T)
    stress = History(np.full_like(T, 1e5), np.full_like(T, 10.0), "Pa")
    given = [
        History(v, s * np.ones_like(T), u) for v, s, u in ((e, 1e-4, "1"), (e1, 1.0, "1/s"), (e2, 1e4, ""))
    ]
    found, log = correct_radial_inertia(stress, *given, SPECIMEN)
    p = radial_pressure(e, e1, e2, density=870.0, radius=SPECIMEN.radius)
    force = p * SPECIMEN.area / (1 - e)  # on the face as it is
    np.testing.assert_allclose(stress.value - found.value, force / SPECIMEN.area, rtol=1e-12)
    assert log.applied
    assert log.size == pytest.approx(float(np.abs(p / (1 - e)).max()))
    # Uncertainty against draws: 4000 of them know a sigma to 1.1 %; 5 % is beyond four of their deviations.
    rng, i = np.random.default_rng(1), 1500
    a, b, c = (h.value[i] + h.sigma[i] * rng.standard_normal(4000) for h in given)
    drawn = radial_pressure(a, b, c, density=870.0, radius=SPECIMEN.radius) / (1 - a)
    assert np.hypot(drawn.std(), 10.0) == pytest.approx(found.sigma[i], rel=0.05)
    left, off = correct_radial_inertia(stress, *given, SPECIMEN, apply=False)
    assert left is stress
    assert not off.applied
    assert off.size == log.size
    with pytest.raises(ValueError, match="one value at each of 4001 times"):
        correct_radial_inertia(stress, History(zero[1:], zero[1:], "1"), *given[1:], SPECIMEN)


def test_axial_stress_is_the_mean_over_layers():
    """Newton's law layer by layer, from the back face up."""
    n, e2, back = 2000, 4e6, 300.0
    rho, L = SPECIMEN.density, SPECIMEN.length
    y = (np.arange(n) + 0.5) * L / n
    momentum = np.cumsum(rho * (back + e2 * y) * L / n)  # above the back face, at each layer's top
    mean = np.mean(momentum) - 0.5 * rho * (back + e2 * L / 2) * L / n  # middle of each layer
    found = axial_stress(e2, density=rho, length=L, back_acceleration=back)
    assert found == pytest.approx(mean, rel=1e-6)  # midpoint rule: 1 / n^2
    second = History(np.full(3, e2), np.full(3, 1e5), "1/s^2")
    stress = History(np.zeros(3), np.ones(3), "Pa")
    corrected, log = correct_axial_inertia(stress, second, SPECIMEN)
    assert corrected.value[0] == pytest.approx(rho * L**2 * e2 / 6)
    assert corrected.sigma[0] == pytest.approx(np.hypot(1.0, rho * L**2 * 1e5 / 6))
    assert log.key == "axial inertia"


def test_a_mass_before_and_behind_the_specimen():
    t = np.linspace(0, 1e-4, 201)
    a = 5e4 * np.sin(2 * np.pi * t / 1e-4)
    force = 30.0 + 0.0071 * a
    mass = Quantity("platen", 0.0071, 2e-5, "kg", "B")
    gauge = History(force, np.full_like(t, 0.4), "N")
    moved = History(a, np.full_like(t, 200.0), "m/s^2")
    found, log = compensate_mass(t, gauge, moved, mass, sigma_time=0.5e-6)
    np.testing.assert_allclose(found.value, 30.0, atol=1e-10)
    assert log.size == pytest.approx(0.0071 * 5e4, rel=1e-6)
    assert log.unit == "N"
    # Draws of mass, clock, acceleration and noise at a steep place; 4000 know sigma to 1.1 %.
    rng, i = np.random.default_rng(2), 10
    shifted = 5e4 * np.sin(2 * np.pi * (t[i] + 0.5e-6 * rng.standard_normal(4000)) / 1e-4)
    drawn = (
        force[i]
        + 0.4 * rng.standard_normal(4000)
        - (0.0071 + 2e-5 * rng.standard_normal(4000)) * (shifted + 200.0 * rng.standard_normal(4000))
    )
    assert drawn.std() == pytest.approx(found.sigma[i], rel=0.05)
    off, log = compensate_mass(t, gauge, moved, mass, apply=False)
    assert off is gauge
    assert not log.applied
    assert log.size > 300.0
    with pytest.raises(ValueError, match="must be > 0 kg"):
        compensate_mass(t, gauge, moved, Quantity("platen", 0.0, 0.0, "kg", "B"))
