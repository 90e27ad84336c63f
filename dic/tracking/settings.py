"""Settings of the tracking of points through a series."""

from dataclasses import dataclass, field

from dic.correlation.settings import Correlation


@dataclass(frozen=True, kw_only=True)
class Tracking:
    """Settings of the tracking of points in time.

    Raises
    ------
    ValueError
        A value outside its range; the message names it.
    """

    correlation: Correlation = field(default_factory=Correlation)
    """Settings of the match of one subset."""
    update_stretch: float = 1.5
    """A point whose subset has been stretched or flattened by this factor since its reference takes the
    picture at hand as the new one; above 1."""
    update_zncc: float = 0.9
    """A point whose correlation stays below this in two successive frames takes a new reference too."""
    growth: float = 1.0
    """A subset that is flattened in the picture may grow in the material by up to this factor, at changes of
    reference, so that its shortest side in the picture stays what it was; 1: it keeps its material."""
    return_every: int = 5
    """Frames between attempts to go back to an earlier reference that fits again; 0: never."""
    search: int = 24
    """Range about its guess in which a point is searched for by cross-correlation when all else fails, half
    the width of the search window [px]; 0: no search."""
    neighbour_gate: float = 1.0
    """A point lies within this distance of where at least two of its neighbours put it [px]."""
    least_valid: float = 0.2
    """A frame in which a smaller share of the points is found is searched anew with seeds."""

    def __post_init__(self) -> None:
        checks = (
            ("update_stretch", 1.0 < self.update_stretch <= 10.0, "above 1, at most 10"),
            ("update_zncc", 0.0 <= self.update_zncc < 1.0, "from 0 to below 1"),
            ("growth", 1.0 <= self.growth <= 10.0, "from 1 to 10"),
            ("return_every", self.return_every >= 0, "0 or more frames"),
            ("search", 0 <= self.search <= 512, "from 0 to 512 px"),
            ("neighbour_gate", self.neighbour_gate > 0.0, "above 0 px"),
            ("least_valid", 0.0 <= self.least_valid <= 1.0, "from 0 to 1"),
        )
        for name, fine, allowed in checks:
            if not fine:
                raise ValueError(f"{name} must be {allowed}, got {getattr(self, name)}")
