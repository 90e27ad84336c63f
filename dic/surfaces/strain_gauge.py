"""What a strain is fitted over, and how the fit at a point ended."""

from dataclasses import dataclass
from enum import IntEnum

FEWEST = {1: 4, 2: 8}
"""Fewest points of a window by the order of its polynomial."""


class StrainOutcome(IntEnum):
    """The end of the strain at one point in one frame."""

    VALID = 0
    POINT_LOST = 1
    TOO_FEW_NEIGHBOURS = 2

    @property
    def ok(self) -> bool:
        """True when the strain may be used."""
        return self is StrainOutcome.VALID

    @property
    def cause(self) -> str:
        """What happened, in one sentence."""
        return _CAUSES[self][0]

    @property
    def cure(self) -> str:
        """What a user can do about it."""
        return _CAUSES[self][1]


_CAUSES = {
    StrainOutcome.VALID: ("a strain was fitted", "nothing to do"),
    StrainOutcome.POINT_LOST: ("the point itself was not found", "see the point's own outcome"),
    StrainOutcome.TOO_FEW_NEIGHBOURS: (
        "too few valid neighbours of the same region, or all of them nearly on a line",
        "enlarge the window, or choose a smaller step",
    ),
}


@dataclass(frozen=True)
class StrainGauge:
    """A virtual strain gauge: the square of the material picture that one strain is fitted over."""

    window: int
    """Points along one side, odd."""
    step: float
    """Distance of neighbouring points [px]."""
    subset: float
    """Side of the subsets [px]."""
    order: int = 1
    """Of the polynomial: 1 or 2."""

    def __post_init__(self) -> None:
        if self.window < 3 or self.window % 2 == 0:
            raise ValueError(f"window must be odd and at least 3 points, got {self.window}")
        if not (self.step > 0.0 and self.subset > 0.0):
            raise ValueError(f"step and subset must be positive [px], got {self.step} and {self.subset}")
        if self.order not in FEWEST:
            raise ValueError(f"order must be 1 or 2, got {self.order}")

    @property
    def size(self) -> float:
        """Its side [px]: (window - 1) step + subset."""
        return (self.window - 1) * self.step + self.subset
