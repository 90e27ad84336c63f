"""Uncertainty budgets: quantities, their propagation, and the Monte Carlo check."""
