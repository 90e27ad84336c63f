"""Outcomes of a search: a named cause with its cure."""

from enum import Enum


class SearchOutcome(Enum):
    """The outcome of a search."""

    CONVERGED = "converged"
    AT_BOUND = "at a bound"
    NOT_CONVERGED = "not converged"

    @property
    def ok(self) -> bool:
        """True when an optimum was found inside the box."""
        return self is SearchOutcome.CONVERGED

    @property
    def cause(self) -> str:
        """The cause in one sentence."""
        return _CAUSES[self][0]

    @property
    def cure(self) -> str:
        """The cure."""
        return _CAUSES[self][1]


_CAUSES = {
    SearchOutcome.CONVERGED: (
        "the simplex shrank to the tolerance at one point twice, and no neighbour is lower",
        "nothing to do",
    ),
    SearchOutcome.AT_BOUND: (
        "the smallest value lies on a face of the box, so the optimum may lie beyond it",
        "widen the box at the parameters and sides named in at_bound, or fix those parameters",
    ),
    SearchOutcome.NOT_CONVERGED: (
        "max_evaluations was used up before the simplex shrank to the tolerance twice at one point",
        "raise max_evaluations or tolerance; if the function is noisy, smooth it first",
    ),
}
