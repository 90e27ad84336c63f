"""Settings of the measurement, and the error of pictures that give nothing."""

from dataclasses import dataclass, field, replace

from dic.correlation import Correlation
from dic.correlation.warp import Shape
from dic.tracking import Tracking

DIRECTIONS = {"up": (0.0, -1.0), "down": (0.0, 1.0), "left": (-1.0, 0.0), "right": (1.0, 0.0)}
"""Directions in a picture (right, down)."""


class ChainError(ValueError):
    """Pictures from which no surface can be had; the text says why and what to do."""


@dataclass(frozen=True, kw_only=True)
class ChainSettings:
    """Settings of the measurement from pictures to surfaces."""

    toward_flyer: str
    """Direction to the flyer in the pictures of camera 0: a key of `DIRECTIONS`."""
    zero: tuple[float, float]
    """End of the specimen at the transmission platen in camera 0's first picture (x, y), to a pixel
    or two [px]: the edge is then found in both cameras' pictures."""
    strip_half_width: float
    """Points within this distance of the centre plane are its outline [m]."""
    radius: float | None = None
    """Radius of the specimen at rest, if it was measured otherwise [m]: the axis then lies by so much behind
    the surface. From the part of the circumference that is seen, a free radius and the place of the axis are
    known less well. None: free."""
    largest_sigma: float | None = None
    """Rows of the outline that are known less well than this are left out of it [m]; None: none."""
    length: float | None = None
    """Length of the specimen at rest [m]: with the flyer's displacement it gives the place of the upper end.
    None: points near that end are not judged by it."""
    length_sigma: float = 0.0
    """Its standard deviation [m]."""
    step: int = 4
    """Distance of neighbouring points [px]."""
    margin: float = 2.0
    """Least distance of a point from its region's rim [px]."""
    strain_window: int = 5
    """Side of the window of points that a strain is fitted to; odd."""
    tracking: Tracking = field(default_factory=Tracking)
    """Settings of the tracking in time."""
    stereo: Correlation = field(default_factory=lambda: Correlation(shape=Shape.QUADRATIC))
    """Settings of the match between the cameras."""
    device: str = "cpu"
    """Device of the correlation."""

    @property
    def subset(self) -> int:
        """Side of the subsets that are followed [px]."""
        return self.tracking.correlation.subset

    @property
    def rigid(self) -> Tracking:
        """Settings of the tracking of the flyer: its points translate, and enter the picture from its
        border."""
        subset = replace(self.tracking.correlation, shape=Shape.RIGID, least_pixels=0.4)
        return replace(self.tracking, correlation=subset)

    @property
    def direction(self) -> tuple[float, float]:
        """From the specimen toward the flyer in the pictures of camera 0 (right, down)."""
        return DIRECTIONS[self.toward_flyer]

    def __post_init__(self) -> None:
        checks = (
            ("toward_flyer", self.toward_flyer in DIRECTIONS, f"one of {', '.join(DIRECTIONS)}"),
            ("strip_half_width", self.strip_half_width > 0.0, "a positive length in metres"),
            ("radius", self.radius is None or self.radius > 0.0, "a positive length in metres, or None"),
            (
                "largest_sigma",
                self.largest_sigma is None or self.largest_sigma > 0.0,
                "a positive length in metres, or None",
            ),
            ("length", self.length is None or self.length > 0.0, "a positive length in metres, or None"),
            ("length_sigma", self.length_sigma >= 0.0, "a length in metres, not negative"),
            ("step", self.step >= 1, "at least 1 px"),
            ("margin", self.margin >= 0.0, "not negative"),
            ("strain_window", self.strain_window >= 3 and self.strain_window % 2 == 1, "odd, at least 3"),
        )
        for name, fine, allowed in checks:
            if not fine:
                raise ValueError(f"{name} must be {allowed}, got {getattr(self, name)}")
