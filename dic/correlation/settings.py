"""How subsets are matched."""

from dataclasses import dataclass

from dic.correlation.warp import Shape


@dataclass(frozen=True, kw_only=True)
class Correlation:
    """Settings of the match of one subset.

    Raises
    ------
    ValueError
        A value outside its range; the message names it.
    """

    subset: int = 21
    """Side of the square subset in the material picture [px]: odd, 5 to 101."""
    shape: Shape = Shape.AFFINE
    """Shape function."""
    prefilter: float = 0.0
    """Standard deviation of the Gaussian that both pictures are smoothed with [px]; 0: none."""
    max_iterations: int = 30
    """A point that needs more ends as NOT_CONVERGED."""
    tolerance: float = 1e-3
    """Converged when the last update moves no corner of the subset by more than this [px]."""
    least_zncc: float = 0.7
    """A point that ends below this zero-normalised cross-correlation is LOW_CORRELATION (1 - ZNSSD/2)."""
    least_pixels: float = 0.5
    """Share of the subset that must lie inside the mask and the pictures; less is OUT_OF_VIEW."""

    def __post_init__(self) -> None:
        checks = (
            ("subset", self.subset % 2 == 1 and 5 <= self.subset <= 101, "odd, from 5 to 101 px"),
            ("prefilter", 0.0 <= self.prefilter <= 5.0, "from 0 to 5 px"),
            ("max_iterations", self.max_iterations >= 1, "at least 1"),
            ("tolerance", 0.0 < self.tolerance < 0.1, "above 0 and below 0.1 px"),
            ("least_zncc", 0.0 <= self.least_zncc < 1.0, "from 0 to below 1"),
            ("least_pixels", 0.0 < self.least_pixels <= 1.0, "above 0, at most 1"),
        )
        for name, fine, allowed in checks:
            if not fine:
                raise ValueError(f"{name} must be {allowed}, got {getattr(self, name)}")
