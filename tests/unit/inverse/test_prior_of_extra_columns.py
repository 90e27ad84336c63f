"""A prior says nothing of what is fitted beside the free parameters."""

from types import SimpleNamespace
from typing import Any

import numpy as np

from kolsky.inverse.objective import Objective


def test_prior_has_no_part_in_a_clocks_lag() -> None:
    prior: Any = SimpleNamespace(precision=np.array([[4.0, 1.0], [1.0, 2.0]]))
    objective: Any = SimpleNamespace(prior=prior)
    wide = Objective.prior_precision(objective, 3)
    assert wide.tolist() == [[4.0, 1.0, 0.0], [1.0, 2.0, 0.0], [0.0, 0.0, 0.0]]
    assert Objective.prior_precision(objective, 2).tolist() == prior.precision.tolist()
    assert not Objective.prior_precision(objective, 2, "force").any()
