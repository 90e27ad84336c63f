"""Polymer bars; figures and tolerances as on the page (`polymer_bar.py`)."""

import polymer_bar as topic


def test_modulus_of_a_zener_solid() -> None:
    result = topic.case()
    assert max(result.clean_error) < topic.CLEAN_TOLERANCE
    assert max(result.noisy_error.values()) < topic.NOISY_TOLERANCE
    assert result.fitted_error < topic.NOISY_TOLERANCE


def test_wavenumbers_satisfy_the_printed_equation() -> None:
    assert topic.case().residual < 1e-8  # a finite difference of the equation turns residuals to wavenumbers


def test_a_pulse_is_sent_back_within_the_band() -> None:
    result = topic.case()
    assert result.back < topic.PULSE_TOLERANCE
    assert result.back_noise < 1.0  # half of the samples' band is left
