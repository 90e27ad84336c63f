"""The gradient of one objective by all parameters and a whole material table: the time loop in reverse."""

from explicit.adjoint.gradients import Gradient, Objective, by_curve_stress, by_table, forward_run, gradient
from explicit.adjoint.passes import StepSequence

__all__ = ["Gradient", "Objective", "StepSequence", "by_curve_stress", "by_table", "forward_run", "gradient"]
