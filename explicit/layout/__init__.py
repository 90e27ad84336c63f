"""Memory layout: the arguments of the time loop, the state of a simulation, and the lanes that share it."""
