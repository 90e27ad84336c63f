"""Settings of a full-field measurement."""

from dataclasses import dataclass, field, replace

from dic.correlation import Correlation
from dic.correlation.warp import Shape
from dic.tracking import Tracking


@dataclass(frozen=True, kw_only=True)
class FullFieldSettings:
    """Settings of a full-field measurement.

    Raises
    ------
    ValueError
        A value outside its range; the message names it.
    """

    step: int = 5
    """Distance of neighbouring points [px]."""
    margin: float = 2.0
    """Least distance of a point from the rim of the mask [px]."""
    tracking: Tracking = field(default_factory=Tracking)
    """Settings of the tracking in time; its subset is that of the measurement."""
    stereo_shape: Shape = Shape.QUADRATIC
    """Shape function of the match between two cameras."""
    strain_window: int = 5
    """Side of the window of points that a strain is fitted to, odd."""
    strain_order: int = 1
    """Order of the polynomial in that window, 1 or 2."""
    reference: int = 0
    """Frame in which the points are chosen and from which displacements are counted."""
    static: int = 1
    """Frames at the beginning in which nothing moves. Two or more give the noise of the grey values and a
    mean reference position."""
    noise: float | None = None
    """Standard deviation of a grey value [grey]; None: from the static frames, or from the residuals of the
    matches where there is only one."""
    device: str = "cpu"
    """Device of the correlation."""

    @property
    def subset(self) -> int:
        """Side of the subsets [px]."""
        return self.tracking.correlation.subset

    @property
    def stereo(self) -> Correlation:
        """Settings of the match between two cameras."""
        return replace(self.tracking.correlation, shape=self.stereo_shape)

    @property
    def gauge(self) -> float:
        """Side of the virtual strain gauge [px]: (window - 1) step + subset."""
        return float((self.strain_window - 1) * self.step + self.subset)

    def __post_init__(self) -> None:
        checks = (
            ("step", self.step >= 1, "at least 1 px"),
            ("margin", self.margin >= 0.0, "not negative"),
            ("strain_window", self.strain_window >= 3 and self.strain_window % 2 == 1, "odd, at least 3"),
            ("strain_order", self.strain_order in (1, 2), "1 or 2"),
            ("reference", self.reference >= 0, "a frame number from 0"),
            ("static", self.static >= 1, "at least 1 frame"),
            ("noise", self.noise is None or self.noise > 0.0, "positive, or None"),
            ("stereo_shape", self.stereo_shape >= Shape.AFFINE, "AFFINE or QUADRATIC"),
        )
        for name, fine, allowed in checks:
            if not fine:
                raise ValueError(f"{name} must be {allowed}, got {getattr(self, name)}")
