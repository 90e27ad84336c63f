"""Whole bodies in equilibrium: specimens of slow tests with their fitted constants, and soft actuators."""
