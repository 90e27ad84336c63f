"""The clock of a simulation: what happens once a step, whatever the number of workers.

While the workers sweep the elements at one time, the step before is settled
(`explicit.time_loop.end_of_step`: forces, records, the support's answer); while they move the nodes, the
next one is planned (`explicit.time_loop.next_step`: its size, where the platens will be). On a GPU a warp of
its own does so, and the workers read the result from shared memory.
"""

TIME, STATUS, GOING, STEPS, SMALLEST_STEP, FIRST_STEP, PAST_DATA, MOST_STRAINED = range(8)
FORCE_FLYER, FORCE_SUPPORT, IMPULSE_FLYER, IMPULSE_SUPPORT = range(8, 12)
LOWER_NEXT, LOWER_SPEED, RECORDED = range(12, 15)
NEXT_FORCE, FORCE_DUE, NEXT_SURFACE, SURFACE_DUE, COMING, COMING_DUE = range(15, 21)
FAULT, VOID, MOST_WORK, PLANS = range(21, 25)
STEP, STEP_BEFORE, INTERVAL, PER_INTERVAL, RATE, FLYER_NEXT, UPPER_SPEED, LEDGER, PLAN = range(9)
CLOCK = PLANS + 2 * PLAN
"""Numbers on the clock; those above say which is which. The plan of a step has its own, at `PLANS` for even
steps and behind them for odd ones, because the next one is made while a plan is carried out. Times and steps
[s], rate [1/s], displacements [m], speeds [m/s], forces [N], impulses [N s]; counters are exact in fp64."""

ELASTIC, HOURGLASS, KINETIC, WORK, DAMPING, FRICTION, LANDING, RESTRAINT, PAST, MOST = range(10)
MOTION, WORK_DONE, TURNED, BEYOND, STIFFEST = range(10, 15)
STIFFER, VISCOUS = STIFFEST + 2, STIFFEST + 4
"""What the workers hand over: totals for the ledger; what the clock watches; twice, in turn, the largest
omega^2 of the law and that of what relaxes."""
N_TOTALS = 19
"""How many numbers they hand over."""

ENDED_AS, FAILED_ELEMENT, STEPS_TAKEN, END_TIME, LEAST_STEP, VOLUME_PAST_DATA, LARGEST_S, ENDING = range(8)
"""What is known of a simulation at its end, and how many numbers that are."""

NO_TIME = 1.0e300
"""Time [s] of a record that never comes."""
