"""The time loop of one simulation, whole, inside one kernel; `explicit.time_loop.kernel` is its story."""
