"""Order in space; figures and tolerances as on the page (`space_order.py`)."""

import pytest
import space_order
from order import assert_order


def test_exact_wave_converges_with_second_order() -> None:
    result = space_order.case()
    for error in (result.wave_position, result.wave_force):
        assert_order(space_order.SIZES, error, 2.0, space_order.ALLOWED)


def test_wave_speed_is_the_rods() -> None:
    # Dispersion of second order, 1e-4 at 96 elements a length, and times sampled every 0.025 passages.
    assert abs(space_order.case().speed_error) < 1e-3


@pytest.mark.parametrize("quantity", space_order.QUANTITIES)
@pytest.mark.parametrize("impact", list(space_order.IMPACTS))
def test_impact_converges_in_space(impact: str, quantity: str) -> None:
    differences = space_order.case().impacts[impact][quantity]
    assert_order(
        space_order.SIZES[:-1],
        differences,
        space_order.IMPACTS[impact],
        space_order.ALLOWED,
        at_least=True,
    )
