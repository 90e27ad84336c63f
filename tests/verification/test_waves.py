"""Guided waves and radial inertia; figures and tolerances as on the page (`waves.py`)."""

import numpy as np
import waves
from order import assert_order


def test_phase_velocities_are_those_of_pochhammer_and_chree() -> None:
    assert np.abs(waves.wave_error(waves.case())[-1]).max() < waves.WAVE_TOLERANCE


def test_phase_velocities_converge_with_second_order() -> None:
    sizes = [1.0 / n for _, n in waves.MESHES]
    error = np.abs(waves.wave_error(waves.case()))
    for mode in (1, 2):  # n = 2 and 3; the error of n = 1 comes down to that of the fitted frequency
        assert_order(sizes, error[:, mode], 2.0, 0.1)


def test_force_of_a_flat_disc_is_its_radial_inertia() -> None:
    result = waves.case()
    assert result.disc_error[-1] < waves.INERTIA_TOLERANCE
    assert (1.0 - result.static / result.closed_form).max() > 0.7  # inertia, not the static stress


def test_compressibility_leaves_the_disc_with_the_duration() -> None:
    # (a / (c duration))^2, and faster while pressure waves are excited at all.
    assert_order(1.0 / np.array(waves.DURATIONS), waves.case().disc_error, 2.0, 0.2, at_least=True)


def test_a_disc_is_homogeneous_the_better_the_flatter_it_is() -> None:
    # y-dependence of the pressure: (h / a)^2, and higher terms at the thickest.
    assert_order(1.0 / np.array(waves.ASPECTS), waves.case().spread, 2.0, 0.3, at_least=True)
