"""Several methods asked the same question: what each of them finds, and whether they agree."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from math import isfinite, nan

SIMPLEX = "surrogate and simplex"
LEAST_SQUARES = "least squares on the solver"
PROFILE = "profile likelihood"
POSTERIOR = "posterior median"

AGREEMENT = 0.25
"""Methods agree while none ends further from the answer than this share of the k = 2 half width."""


@dataclass(frozen=True)
class Method:
    """The free parameters by one method of searching, from the same data."""

    name: str
    """`SIMPLEX`, `LEAST_SQUARES`, `PROFILE` or `POSTERIOR`."""
    values: dict[str, float]
    """What it finds, in parameter units."""
    distances: dict[str, float]
    """Value minus the answer, over the half width of the answer's k = 2 interval [-]; NaN where the method
    has no value or the answer no width."""
    runs: int
    """Simulations it took, those of the surrogate it rests on included."""
    shared_runs: int
    """How many of them another method made; a method on the answer's surrogate has no runs of its own."""
    converged: bool
    """Whether it ended by its own criterion."""
    ended: str
    """How it ended, in words."""

    @classmethod
    def compared(
        cls,
        name: str,
        values: Mapping[str, float],
        *,
        answer: Mapping[str, float],
        half_width: Mapping[str, float],
        runs: int,
        shared_runs: int = 0,
        converged: bool = True,
        ended: str = "",
    ) -> "Method":
        """A method's result beside the answer.

        Parameters
        ----------
        name, runs, shared_runs, converged, ended
            The fields of this name.
        values
            What it finds, in parameter units.
        answer, half_width
            The answer and half the length of its k = 2 interval, in parameter units.

        Raises
        ------
        ValueError
            If the names differ.
        """
        if not set(values) == set(answer) == set(half_width):
            raise ValueError(
                f"{name}: values for {sorted(values)}, the answer is for {sorted(answer)} and its interval "
                f"for {sorted(half_width)}"
            )
        return cls(
            name=name,
            values=dict(values),
            distances={
                p: (value - answer[p]) / half_width[p] if half_width[p] > 0.0 else nan
                for p, value in values.items()
            },
            runs=runs,
            shared_runs=shared_runs,
            converged=converged,
            ended=ended,
        )


def disagreements(methods: Iterable[Method]) -> Iterator[tuple[Method, str, float]]:
    """Method, parameter and distance wherever it is beyond `AGREEMENT`, or not known."""
    for method in methods:
        for parameter, distance in method.distances.items():
            if not isfinite(distance) or abs(distance) > AGREEMENT:
                yield method, parameter, distance
