"""Robust estimates of a standard deviation from medians."""

MAD = 1.4826
"""Standard deviation of a normal distribution over the median of its absolute deviations: 1/Φ⁻¹(3/4)."""
MEDIAN_LENGTH = 1.18
"""Median length of a vector of two independent unit normal components: √(2 ln 2)."""
