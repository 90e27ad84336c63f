"""Thresholds of the verdicts on a fit, in one place."""

LIMITS = {"force": 3.0, "outline": 2.0}
"""Largest residual over what a right model leaves, by channel [-]."""
SLOW_LIMITS = {"force": 3.0, "outline": 3.0}
"""The same of the means over blocks [-]."""
ALONE = 0.1
"""A channel with less than this share of the information on a parameter has no say in its value."""
CHECKS = 2.0
"""But by itself it checks the value if its standard uncertainty is at most so many times the answer's."""
CONTRADICTION = 4.0
"""Force and outline contradict each other beyond so many standard uncertainties of their difference."""
LATE = 3.0
"""A clock is wrong beyond so many standard uncertainties of its lag."""
UNEXPLAINED = 2.5
"""Misfit of a channel from which on causes far away are tried; 1 is what a right model leaves, and below this
a tangent reaches whatever is wrong."""
