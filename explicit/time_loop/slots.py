"""The control record of a simulation, and the names of its slots.

While the workers sweep the elements at one time, the control warp ends the step before
(`explicit.time_loop.end_of_step`: forces, records, the support's answer); while they move the nodes, it
plans the next one (`explicit.time_loop.next_step`: its size, where the platens will be). The workers read the
result from the record, which lies in shared memory on a GPU. On a CPU every lane is worker and control at
once.
"""

from enum import IntEnum


class Control(IntEnum):
    """Slots of the control record.

    Times and steps [s], displacements [m], speeds [m/s], forces [N], impulses [N s]; counters are exact in
    fp64.
    """

    TIME = 0
    """Time of the positions that the last finished step led to."""
    STATUS = 1
    """`explicit.outcome.Outcome` so far."""
    GOING = 2
    """1 until the simulation ends."""
    STEPS = 3
    """Steps finished."""
    SMALLEST_STEP = 4
    FIRST_STEP = 5
    PAST_DATA = 6
    """Largest volume past the material's data [m^3]."""
    MOST_STRAINED = 7
    """Largest s = sqrt(I1_bar - 3) [-]."""
    FORCE_FLYER = 8
    FORCE_SUPPORT = 9
    IMPULSE_FLYER = 10
    IMPULSE_SUPPORT = 11
    LOWER_NEXT = 12
    """Displacement of the support at the end of the step."""
    LOWER_SPEED = 13
    """Speed of the support in the step."""
    RECORDED = 14
    """Values of the outgoing wave stored so far."""
    NEXT_FORCE = 15
    """Row of the next force record."""
    FORCE_DUE = 16
    """Its time."""
    NEXT_SURFACE = 17
    """Row of the next record of positions."""
    SURFACE_DUE = 18
    """Its time."""
    PLANNED = 19
    """Row of the next record of positions, as the planned step will leave it."""
    PLANNED_DUE = 20
    """Its time."""
    FAULT = 21
    """Outcome that ends the simulation with the step under way, or 0."""
    VOID = 22
    """1 where the step under way began after something had gone wrong and counts no more."""
    MOST_WORK = 23
    """Largest work of the platens so far [J]."""
    PLANS = 24
    """Where the plans of steps begin: even steps, then odd ones, since one is made while the other is carried
    out."""


class Plan(IntEnum):
    """Slots of the plan of a step."""

    STEP = 0
    STEP_BEFORE = 1
    INTERVAL = 2
    """Time over which the forces change the velocities: half of both steps."""
    PER_INTERVAL = 3
    RATE = 4
    """1 over the step [1/s]."""
    FLYER_NEXT = 5
    """Displacement of the flyer at the end of the step."""
    UPPER_SPEED = 6
    """Speed of the flyer in the step, upwards."""
    LEDGER = 7
    """1 where energies are recorded in the step."""
    SIZE = 8


class Total(IntEnum):
    """Numbers that the workers hand over: totals of the ledger [J] first, then what control watches."""

    ELASTIC = 0
    HOURGLASS = 1
    KINETIC = 2
    WORK = 3
    DAMPING = 4
    FRICTION = 5
    LANDING = 6
    RESTRAINT = 7
    PAST = 8
    """Volume past the material's data [m^3]."""
    MOST = 9
    """Largest s [-]."""
    MOTION = 10
    """Kinetic energy, for divergence [J]."""
    WORK_DONE = 11
    """Work of the platens, for divergence [J]."""
    TURNED = 12
    """Largest omega^2 since the last measurement: that of a turned element stands out [1/s^2]."""
    BEYOND = 13
    """Largest s past the data, where that ends a simulation [-]."""
    STIFFEST = 14
    """Largest omega^2 of the law, of even and of odd steps [1/s^2]."""
    STIFFER = 16
    """Largest omega^2 of what relaxes, of even and of odd steps [1/s^2]."""
    VISCOUS = 18
    """Work done on the branches that relax [J]."""
    COUNT = 19


class Share(IntEnum):
    """Sums over elements of every step that threads of a CPU make together."""

    POWER = 0
    """Power lost to damping [W]."""
    ARTIFICIAL = 1
    """Power of the hourglass control [W]."""
    COUNT = 2


class Ending(IntEnum):
    """Slots of what is known of a simulation at its end."""

    STATUS = 0
    FAILED_ELEMENT = 1
    STEPS = 2
    END_TIME = 3
    SMALLEST_STEP = 4
    PAST_DATA = 5
    MOST_STRAINED = 6
    COUNT = 7


CONTROL_SIZE = int(Control.PLANS) + 2 * int(Plan.SIZE)
"""Numbers of the control record."""
NO_TIME = 1.0e300
"""Time [s] of a record that never comes."""
