"""The complete time loop of one simulation inside one kernel; begin with `explicit.time_loop.kernel`."""
