"""A kind of design in the registry: its function, its name at a command line, the options that it needs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from numpy.typing import ArrayLike

from doe.box import Box
from doe.designs.design import Design, Rng

Need = Literal["levels", "runs", "rng", "generators", "candidates", "points"]


@dataclass(frozen=True)
class DesignKind:
    """A kind of design; called with the box and the function's own arguments it gives the design."""

    function: Callable[..., Design]
    """Takes the box first, then what `needs` says under the names of `DesignKind.make`; "runs" is its n."""
    option: str
    """Name at a command line."""
    needs: tuple[Need, ...]
    """Options that the function takes, of those of `make`."""
    summary: str
    """What it is good for, in a few words."""

    def __call__(self, box: Box, *arguments: Any, **options: Any) -> Design:
        """The design by the function's own arguments."""
        return self.function(box, *arguments, **options)

    def make(
        self,
        box: Box,
        *,
        levels: int | Sequence[int] = 5,
        runs: int = 64,
        rng: Rng = 1,
        generators: str = "",
        candidates: ArrayLike | None = None,
        points: ArrayLike | None = None,
    ) -> Design:
        """The design by options that are the same for all kinds; those it does not need are not looked at.

        Parameters
        ----------
        box
            Where.
        levels
            Number of levels, one for all parameters or one each.
        runs
            Number of points.
        rng
            Integer seed or NumPy generator.
        generators
            Words of a fractional factorial.
        candidates
            Points to choose from, in parameter units, shape [c, d]; the kind's own if None.
        points
            Points chosen elsewhere, in parameter units, shape [n, d].

        Raises
        ------
        ValueError
            If an option does not fit the box or the kind.
        """
        given = {
            "levels": levels,
            "runs": runs,
            "rng": rng,
            "generators": generators,
            "candidates": candidates,
            "points": points,
        }
        return self.function(box, **{"n" if name == "runs" else name: given[name] for name in self.needs})
