"""How a plan's numbers are written: to the second digit of the uncertainty, in the units of reports."""

import numpy as np
import pytest

from kolsky.studies.planning.output import _measured, _sigmas


@pytest.mark.parametrize(
    ("value", "U", "wanted"),
    [
        (1.12, 0.00189, "1.1200 ± 0.0019"),
        (0.499, 3.04e-6, "0.4990000 ± 0.0000030"),
        (25.0, 0.284, "25.00 ± 0.28"),
        (1234.4, 56.0, "1234 ± 56"),
        (1.12, np.inf, "1.12 ± inf"),
    ],
)
def test_value_and_uncertainty_end_at_the_same_digit(value: float, U: float, wanted: str) -> None:
    assert _measured(value, U) == wanted


def test_each_parameter_is_doubled_and_in_its_own_unit() -> None:
    """k = 2; damping is held in s and shown in us."""
    told = _sigmas(np.array([0.001, 0.16e-6]), ("stiffness_factor", "damping"))
    assert told == "m ± 0.002, beta ± 0.32 us"
