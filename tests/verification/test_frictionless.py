"""Frictionless static compression; figures and tolerances as on the page (`frictionless.py`)."""

import frictionless
import numpy as np
from order import assert_order


def test_force_is_the_closed_form_to_60_percent() -> None:
    assert np.abs(frictionless.case().force).max() < frictionless.FORCE_TOLERANCE


def test_mean_radius_is_the_closed_form() -> None:
    error = np.abs(frictionless.case().radius)
    stable = frictionless.STABLE
    assert error[..., stable].max() < frictionless.RADIUS_TOLERANCE["stable"]
    assert error[..., ~stable].max() < frictionless.RADIUS_TOLERANCE["past"]


def test_deformation_stays_homogeneous_below_the_surface_instability() -> None:
    # 2 micrometres on a radius of 5 mm: the inertia of the loading, 0.2 % of the stress, bulges that much.
    assert frictionless.case().spread[..., frictionless.STABLE].max() < 2e-6


def test_dynamic_residual_falls_with_the_square_of_the_loading_time() -> None:
    # Inertial stress goes as acceleration, duration^-2; 0.1 leaves room for the next term of the series.
    assert_order(1.0 / np.array(frictionless.DURATIONS), frictionless.case().slow, 2.0, 0.1)


def test_slow_loading_leaves_the_homogeneous_state_at_biots_stretch() -> None:
    # Critical stretch 0.444 of an incompressible half-space (Biot 1963); 0.02 for nu = 0.495, the finite
    # length of the specimen and the time the wrinkles need to grow to 20 micrometres.
    assert abs(1.0 - frictionless.case().onset - 0.444) < 0.02
