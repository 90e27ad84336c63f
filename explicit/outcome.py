"""End of a simulation: a named cause with its time, its element and its cure, never a silent NaN."""

from dataclasses import dataclass
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
    TABLE_EXCEEDED = 5

    @property
    def ok(self) -> bool:
        """True when the simulation reached its end time."""
        return self is Outcome.COMPLETED

    @property
    def cause(self) -> str:
        """Cause, in one sentence."""
        return _TEXTS[self][0]

    @property
    def cure(self) -> str:
        """Cure: the user's next step."""
        return _TEXTS[self][1]

    @property
    def role(self) -> str:
        """Part of the named element in the failure; empty if the simulation completed."""
        return _TEXTS[self][2]


_TEXTS = {
    Outcome.COMPLETED: ("the end time was reached", "nothing to do", ""),
    Outcome.INVERTED: (
        "an element turned inside out (J <= 0)",
        "refine the mesh, lower safety, or end the window before the specimen folds",
        "the smallest J",
    ),
    Outcome.DIVERGED: (
        "the specimen moves with more energy than the platens gave it, or a force is not a finite number",
        "lower measure_every or safety, end the window before the specimen is crushed, and check that the "
        "material curve does not soften to nothing",
        "the fastest corners",
    ),
    Outcome.STEP_COLLAPSED: (
        "the stable step fell below the share `floor` of its initial value",
        "end the window before the specimen is crushed, lower poisson, or use deviatoric damping",
        "the shortest stable step",
    ),
    Outcome.STEP_LIMIT: (
        "max_steps was used up",
        "raise max_steps or shorten the window",
        "the shortest stable step",
    ),
    Outcome.TABLE_EXCEEDED: (
        "the material was strained past the data of its curve, s = sqrt(I1_bar - 3)",
        "measure the curve to larger strain, end the window earlier, or let the law continue: past_data = "
        '"continue"',
        "the largest s",
    ),
}


@dataclass(frozen=True)
class Ending:
    """End of one simulation: outcome, time and place."""

    outcome: Outcome
    """How."""
    time: float
    """The time it reached [s]."""
    element: int = -1
    """The element where it failed; -1 if it completed."""
    place: tuple[float, float] = (float("nan"), float("nan"))
    """Centre (R, Y) of that element in the undeformed mesh, Y above the transmission platen [m]; NaN if the
    simulation completed."""

    @property
    def where(self) -> str:
        """The moment and the element, e.g. "at 280.3 us in element 87 (R = 4.45 mm, Y = 6.21 mm)"."""
        moment = f"at {1e6 * self.time:.1f} us"
        if self.element < 0:
            return moment
        r, y = self.place
        return f"{moment} in element {self.element} (R = {1e3 * r:.2f} mm, Y = {1e3 * y:.2f} mm)"

    @property
    def sentence(self) -> str:
        """Cause, time, element and cure, without a final stop."""
        if self.outcome.ok:
            return f"{self.outcome.name} {self.where}"
        element = f"; the element has {self.outcome.role}" if self.element >= 0 else ""
        return f"{self.outcome.name} {self.where}: {self.outcome.cause}{element}. Cure: {self.outcome.cure}"
