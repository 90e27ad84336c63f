"""Order in time; figures and tolerances as on the page (`time_order.py`)."""

import pytest
import time_order
from order import assert_order


@pytest.mark.parametrize("quantity", time_order.QUANTITIES)
def test_undamped_motion_is_second_order_in_time(quantity: str) -> None:
    assert_order(
        time_order.STEPS[:-1], time_order.case().undamped[quantity], 2.0, time_order.ALLOWED
    )  # the next term at the coarsest steps moves the fit by 0.03


@pytest.mark.parametrize("quantity", time_order.QUANTITIES)
def test_damping_with_the_lagged_velocity_is_first_order(quantity: str) -> None:
    # Three smallest steps: at the larger ones the second-order part is still as large.
    assert_order(time_order.STEPS[-4:-1], time_order.case().damped[quantity][-3:], 1.0, time_order.ALLOWED)


def test_first_order_part_is_small_at_the_usual_step() -> None:
    # Half a step over the damping time is 3 %, of a damping force that is a tenth of the whole: 0.3 %.
    assert time_order.lag(time_order.case(), "transmission force") < time_order.LAG_TOLERANCE
