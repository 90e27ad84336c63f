"""Memory layout: arguments of the time loop, state of a simulation, and lanes that share it."""
