"""Derivatives of a run: a contributed folder that the solver does not import.

The names below give the gradient of one objective by all parameters and a whole material table, with the
time loop in reverse; `perturbed_runs` gives derivatives of whole histories.
"""

from contributed.adjoint.gradients import (
    Gradient,
    Objective,
    by_curve_stress,
    by_table,
    forward_run,
    gradient,
)
from contributed.adjoint.passes import StepSequence

__all__ = ["Gradient", "Objective", "StepSequence", "by_curve_stress", "by_table", "forward_run", "gradient"]
