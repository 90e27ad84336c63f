"""End of a calculation: a named cause with its cure."""

from enum import IntEnum


class Outcome(IntEnum):
    """How a history of equilibria ended."""

    COMPLETED = 0
    NOT_CONVERGED = 1
    INVERTED = 2
    SINGULAR = 3
    THICKNESS = 4
    PENETRATION = 5
    UNFINISHED = 6

    @property
    def ok(self) -> bool:
        """True when every step was reached."""
        return self is Outcome.COMPLETED

    @property
    def cause(self) -> str:
        """Cause, in one sentence."""
        return _TEXTS[self][0]

    @property
    def cure(self) -> str:
        """The user's next step."""
        return _TEXTS[self][1]


_TEXTS = {
    Outcome.COMPLETED: ("every step was reached", "nothing to do"),
    Outcome.NOT_CONVERGED: (
        "Newton's iteration found no equilibrium, however small the step was made",
        "look for buckling or a limit point of the load, prescribe displacements in place of forces, or "
        "check the constants of the law",
    ),
    Outcome.INVERTED: (
        "an element turned inside out (J <= 0)",
        "refine the mesh where it deforms most, or end the history earlier",
    ),
    Outcome.SINGULAR: (
        "the tangent stiffness is singular",
        "hold the rigid motions of every part, or look for buckling",
    ),
    Outcome.THICKNESS: (
        "no thickness stretch makes the stress across the sheet zero",
        "check the constants of the law, or end the history earlier",
    ),
    Outcome.UNFINISHED: (
        "the path did not reach its last load within its steps",
        "allow more or longer steps, or end at a load that the body can carry",
    ),
    Outcome.PENETRATION: (
        "a contact did not close within its tolerance",
        "raise the stiffness or the tolerance of the contact, or take smaller steps",
    ),
}
