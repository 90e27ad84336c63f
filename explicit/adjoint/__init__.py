"""The gradient of one objective by all parameters and a whole material table: the time loop in reverse."""

from explicit.adjoint.curve import by_curve_stress, by_table
from explicit.adjoint.gradients import Gradient, Objective, forward_run, gradient
from explicit.adjoint.steps import StepSequence

__all__ = ["Gradient", "Objective", "StepSequence", "by_curve_stress", "by_table", "forward_run", "gradient"]
