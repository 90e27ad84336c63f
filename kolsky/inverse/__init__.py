"""The inverse method: parameters, simulations of a shot, misfit, searches, result."""
