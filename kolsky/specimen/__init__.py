"""Whole specimens in slow tests: simulated to equilibrium, and the constants of their law fitted to them."""
