"""Elastic parts by the response to one pulse: a bar in closed form, a rigid body, what a simulation lost."""

import numpy as np
import pytest

from explicit.bars import Section, elastic_bar, pulse_on_bars, pulse_on_mesh
from explicit.bars.elastic import mean_about

STEEL = {"radius": 7.5e-3, "youngs_modulus": 190e9, "density": 8048.0}
BAR = Section(0.25, **STEEL)
STEP, N = 1e-6, 181
TIMES = STEP * np.arange(N)


def constant(force: float) -> np.ndarray:
    return (force * TIMES)[None]


def test_a_constant_force_on_a_bar_moves_its_face_by_force_over_impedance_and_echoes() -> None:
    found = pulse_on_bars([BAR], step=STEP, n=N, sensor=0.1, observed=0.05)
    trip = 2.0 * BAR.travel_time
    path = 3.0 / BAR.impedance * (TIMES + 2.0 * np.maximum(TIMES - trip, 0.0))
    # The first half step's force comes half a step late: 3 N / Z 0.5 us; travel times are rounded to 0.1 us.
    np.testing.assert_allclose(
        found.histories(constant(3.0), "path")[0], path, atol=3.0 / BAR.impedance * 1e-6
    )
    late = 0.05 / BAR.wave_speed
    seen = 3.0 / BAR.impedance * (np.maximum(TIMES - late, 0.0) + np.maximum(TIMES + late - trip, 0.0))
    seen += 3.0 / BAR.impedance * np.maximum(TIMES - late - trip, 0.0)
    np.testing.assert_allclose(
        found.histories(constant(3.0), "seen")[0], seen, atol=3.0 / BAR.impedance * 1e-6
    )
    section = found.histories(constant(3.0), "section")[0]
    arrival, back = 0.1 / BAR.wave_speed, trip - 0.1 / BAR.wave_speed
    np.testing.assert_allclose(section[arrival - 2e-6 > TIMES], 0.0, atol=1e-9)
    between = (arrival + 2e-6 < TIMES) & (back - 2e-6 > TIMES)
    np.testing.assert_allclose(section[between], 3.0, rtol=1e-9)
    np.testing.assert_allclose(section[(back + 2e-6 < TIMES) & (trip > TIMES)], 0.0, atol=1e-9)


def test_a_short_body_accelerates_as_its_mass_and_a_section_carries_what_lies_behind() -> None:
    short = Section(0.02, **STEEL)
    force = np.sin(np.pi * TIMES / TIMES[-1])
    impulse = np.concatenate([[0.0], np.cumsum(0.5 * STEP * (force[1:] + force[:-1]))])[None]
    found = pulse_on_bars([short], step=STEP, n=N, sensor=0.005)
    speed = np.gradient(found.histories(impulse, "path")[0], STEP)
    np.testing.assert_allclose(
        speed[5:-5], impulse[0, 5:-5] / short.mass, atol=0.02 * impulse.max() / short.mass
    )
    # A free body: behind the section three quarters of the mass are pushed, by three quarters of the force.
    section = found.histories(impulse, "section")[0]
    np.testing.assert_allclose(section, 0.75 * force, atol=0.02)


def test_a_mesh_is_a_bar_where_waves_are_long_and_its_march_in_time_where_not() -> None:
    parts = [Section(0.03, **STEEL), Section(0.05, **(STEEL | {"radius": 5e-3}))]
    force = np.sin(np.pi * TIMES / TIMES[-1]) ** 2
    impulse = np.concatenate([[0.0], np.cumsum(0.5 * STEP * (force[1:] + force[:-1]))])[None]
    kind = {"step": STEP, "n": N, "sensor": 0.015, "seen": 0.01}
    mesh = pulse_on_mesh(parts, size=5e-3, radius=4e-3, **kind)
    line = pulse_on_bars(parts, **kind)
    for name, size in (("path", 0.03), ("seen", 0.03), ("section", 0.03)):
        a, b = mesh.histories(impulse, name)[0], line.histories(impulse, name)[0]
        np.testing.assert_allclose(a, b, atol=size * np.abs(b).max())  # the neck of the step, the patch
    marched = elastic_bar(parts, size=5e-3, depths=[0.015], marks=[0.01]).integrate(TIMES, force, 4e-3)
    for name, values in (
        ("path", marched.path),
        ("seen", marched.seen[:, 0]),
        ("section", marched.section_force[:, 0]),
    ):
        found = mesh.histories(impulse, name)[0]
        wanted = np.interp(TIMES, marched.times, values)
        np.testing.assert_allclose(found, wanted, atol=3e-3 * np.abs(wanted).max())


def test_the_pulses_have_the_impulse_and_nothing_presses_after_a_simulation_is_lost() -> None:
    impulse = np.array([[0.0, 1.0, 3.0, 6.0, 6.5], [0.0, 2.0, 4.0, np.nan, np.nan]])
    force = mean_about(impulse, 0.5)
    np.testing.assert_allclose(force[0], [0.0, 4.0, 5.0, 3.5, 1.0])
    np.testing.assert_allclose(force[1], [0.0, 6.0, 2.0, 0.0, 0.0])
    whole = force * 0.5
    assert whole[0].sum() - 0.25 * force[0, -1] == pytest.approx(6.5)  # the last one reaches half a step on


def test_more_steps_than_were_run_are_refused() -> None:
    with pytest.raises(ValueError, match="5 steps are asked for, the pulse's response has 4"):
        pulse_on_bars([BAR], step=STEP, n=4).histories(np.zeros((1, 5)), "path")
