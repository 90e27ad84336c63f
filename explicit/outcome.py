"""How a simulation ended: a named cause with its cure, never a silent NaN."""

from enum import IntEnum


class Outcome(IntEnum):
    """The end of one simulation of a batch.

    The integer values are those the time loop writes; they are not part of the API.
    """

    COMPLETED = 0
    INVERTED = 1
    DIVERGED = 2
    STEP_COLLAPSED = 3
    STEP_LIMIT = 4

    @property
    def ok(self) -> bool:
        """True when the simulation reached its end time."""
        return self is Outcome.COMPLETED

    @property
    def cause(self) -> str:
        """What happened, in one sentence."""
        return _CAUSES[self][0]

    @property
    def cure(self) -> str:
        """What a user can do about it."""
        return _CAUSES[self][1]


_CAUSES = {
    Outcome.COMPLETED: ("the end time was reached", "nothing to do"),
    Outcome.INVERTED: (
        "an element turned inside out (J <= 0)",
        "refine the mesh, lower step_safety, or end the window before the specimen folds",
    ),
    Outcome.DIVERGED: (
        "a displacement stopped being a finite number",
        "lower step_safety; check density, stiffness and damping",
    ),
    Outcome.STEP_COLLAPSED: (
        "the stable step fell below step_floor of its initial value",
        "end the window before the specimen is crushed, lower poisson, or use deviatoric damping",
    ),
    Outcome.STEP_LIMIT: ("max_steps was used up", "raise max_steps or shorten the window"),
}
