"""Settings of a stereo match: the search for initial guesses, and the gates."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, kw_only=True)
class StereoSearch:
    """Search for initial guesses.

    Raises
    ------
    ValueError
        A value outside its range; the message names it.
    """

    distances: tuple[float, float] | None = None
    """Nearest and farthest distance of the specimen along camera 0's rays [m]; None: wherever the
    epipolar curves lie in camera 1's picture."""
    stretching_turns: tuple[float, ...] = (-50.0, -25.0, 0.0, 25.0, 50.0)
    """Turns of a small facet within the epipolar plane that are tried, from facing both cameras alike [°]."""
    shearing_turns: tuple[float, ...] = (-25.0, 0.0, 25.0)
    """Turns of it out of the epipolar plane [°]."""
    seeds: int = 40
    """Number of points, spread over all, that are looked for along their whole epipolar curve."""
    subset: int | None = None
    """Side of the subset for this search [px]; None: the match's, or 31 px if that is smaller."""
    least_zncc: float = 0.6
    """A seed needs this correlation at its best place."""
    distinct: float = 0.6
    """A seed's ZNSSD must be below this share of that of the second peak."""
    neighbours: int = 8
    """Number of nearest points that may pass on a guess."""
    attempts: int = 3
    """Number of neighbours' guesses that a point tries before it is given up."""

    @property
    def turns(self) -> NDArray[np.float64]:
        """All pairs of turns within and out of the epipolar plane [rad], shape [n, 2]."""
        return np.radians([(a, b) for a in self.stretching_turns for b in self.shearing_turns])

    def __post_init__(self) -> None:
        near, far = self.distances if self.distances is not None else (1.0, 2.0)
        turns = (*self.stretching_turns, *self.shearing_turns)
        enough = bool(self.stretching_turns) and bool(self.shearing_turns)
        subset = 31 if self.subset is None else self.subset
        _check(
            ("distances", self.distances, 0.0 < near < far < np.inf, "two positive lengths [m], near < far"),
            (
                "turns",
                turns,
                enough and all(abs(turn) < 80.0 for turn in turns),
                "at least one of each, below 80°",
            ),
            ("seeds", self.seeds, self.seeds >= 1, "at least 1"),
            ("subset", self.subset, subset % 2 == 1 and 5 <= subset <= 201, "odd, from 5 to 201 px"),
            ("least_zncc", self.least_zncc, 0.0 <= self.least_zncc < 1.0, "from 0 to below 1"),
            ("distinct", self.distinct, 0.0 < self.distinct < 1.0, "between 0 and 1"),
            ("neighbours", self.neighbours, self.neighbours >= 1, "at least 1"),
            ("attempts", self.attempts, self.attempts >= 1, "at least 1"),
        )


@dataclass(frozen=True, kw_only=True)
class StereoGates:
    """Gates that a match must pass; each by itself, none knows another's number.

    Raises
    ------
    ValueError
        A value outside its range; the message names it.
    """

    sigmas: float = 4.0
    """Standard deviations of the match that the distances below are widened by."""
    epipolar: float = 0.5
    """Greatest distance from the epipolar line for an exact match: what the calibration leaves [px]."""
    facet: float = 1.0
    """Greatest part of the subset's deformation that no piece of surface can cause, at its rim [px]."""
    back_match: float = 0.5
    """Greatest distance from the point to where its match is found back in camera 0 [px]."""
    neighbours: float = 0.5
    """Greatest distance from where the neighbours' warps put the point, median over them [px]."""
    distinct: float = 0.6
    """Greatest share of the second peak's ZNSSD, in both directions."""
    unseen: float = 0.15
    """Greatest share of the subset that a picture may miss: at a picture's rim the middle of a curved subset
    is extrapolated. What a mask leaves out does not count."""
    incidence: float = 75.0
    """Greatest angle between a ray and the surface's normal, for both cameras [°]."""

    def __post_init__(self) -> None:
        _check(
            ("sigmas", self.sigmas, 0.0 <= self.sigmas < np.inf, "finite, not negative"),
            ("epipolar", self.epipolar, self.epipolar > 0.0, "a positive distance [px]"),
            ("facet", self.facet, self.facet > 0.0, "a positive distance [px]"),
            ("back_match", self.back_match, self.back_match > 0.0, "a positive distance [px]"),
            ("neighbours", self.neighbours, self.neighbours > 0.0, "a positive distance [px]"),
            ("distinct", self.distinct, 0.0 < self.distinct <= 1.0, "above 0, at most 1"),
            ("unseen", self.unseen, 0.0 <= self.unseen < 1.0, "from 0 to below 1"),
            ("incidence", self.incidence, 0.0 < self.incidence <= 90.0, "above 0, at most 90°"),
        )


def _check(*checks: tuple[str, object, bool, str]) -> None:
    for name, value, fine, allowed in checks:
        if not fine:
            raise ValueError(f"{name} must be {allowed}, got {value}")
