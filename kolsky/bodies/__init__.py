"""Whole bodies in equilibrium: specimens of slow tests with fitted constants, and soft actuators."""
