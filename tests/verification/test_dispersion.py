"""Dispersion of bar waves; figures and tolerances as on the page (`dispersion.py`)."""

import dispersion as topic
import pytest
from order import assert_order

pytestmark = pytest.mark.slow  # a finite-element bar of 44 000 elements


def test_roots_of_the_frequency_equation() -> None:
    result = topic.case()
    assert result.roots.max() < topic.ROOT_TOLERANCE
    assert result.reference_error < topic.ROOT_TOLERANCE


def test_pulses_are_carried_and_recovered() -> None:
    result = topic.case()
    assert result.forward.max() < topic.PULSE_TOLERANCE
    assert result.back.max() < topic.PULSE_TOLERANCE
    assert result.shift.min() > 20.0 * topic.PULSE_TOLERANCE  # there is something to correct


def test_a_finite_element_bar_disperses_alike() -> None:
    result = topic.case()
    assert result.element_error[-1] < topic.PULSE_TOLERANCE
    assert result.element_shift > 20.0 * topic.PULSE_TOLERANCE
    assert_order(topic.SIZES, result.element_error, 2.0, topic.ORDER_TOLERANCE)
