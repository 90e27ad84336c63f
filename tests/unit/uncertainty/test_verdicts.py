"""The verdict on a parameter, from where the optimum lies and what confirms it."""

import numpy as np
import pytest

from doe import Box
from kolsky.inverse.estimates import estimates
from kolsky.inverse.result import Verdict
from kolsky.studies.rates.records import COUNTED

BOX = Box(("stiffness_factor", "friction", "damping"), (0.75, 0.05, 1e-6), (1.5, 1.0, 6e-5))
INSIDE = (1.1, 0.3, 2.5e-5)


def verdicts(optimum, *, confirmed=True, outline=True, sigma=(0.01, 0.02, 1e-6)):
    zero = {"mesh": np.zeros(3)}
    found = estimates(
        BOX, np.array(optimum), noise={"force and shape": np.array(sigma)}, numerical=zero,
        mesh_shift=np.zeros(3), confirmed=confirmed, outline=outline,
    )  # fmt: skip
    return [found[name].outcome for name in BOX.names]


def test_inside_and_confirmed_all_are_identified():
    assert verdicts(INSIDE) == [Verdict.IDENTIFIED] * 3
    assert verdicts(INSIDE, outline=False) == [Verdict.FORCE_ALONE] * 3


@pytest.mark.parametrize("friction", [0.05, 1.0])
def test_beside_one_at_its_bound_the_others_hold_only_with_it(friction):
    optimum = (INSIDE[0], friction, INSIDE[2])
    assert verdicts(optimum) == [Verdict.CONDITIONAL, Verdict.AT_BOUND, Verdict.CONDITIONAL]
    assert verdicts(optimum, outline=False)[0] is Verdict.CONDITIONAL
    assert Verdict.CONDITIONAL not in COUNTED  # so a fit over shots leaves it out, and says so


def test_what_is_worse_is_said_first():
    at_bound = (INSIDE[0], 1.0, INSIDE[2])
    assert verdicts(at_bound, confirmed=False)[0] is Verdict.DISAGREEING
    # Four standard uncertainties of 0.2 are longer than the design's 0.75.
    assert verdicts(at_bound, sigma=(0.2, 0.02, 1e-6))[0] is Verdict.NOT_SEEN
