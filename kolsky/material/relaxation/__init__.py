"""Rate dependence from relaxation, oscillation and tests at several rates."""
