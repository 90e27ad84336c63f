"""The instruments of a planned test: windows, bins, pictures and noise."""

from dataclasses import dataclass

import numpy as np

from kolsky.inverse.prepared_shot import PreparedShot


@dataclass(frozen=True)
class Instruments:
    """The instruments of a planned test."""

    window: tuple[float, float]
    """First and last time that is compared, of a test at the shot's own rate [s]."""
    bin_width: float
    """Width of the bins over which the force is averaged [s]."""
    force_sigma: float
    """Standard deviation of a bin's mean [N]."""
    frame_interval: float
    """Time from picture to picture [s]."""
    points: float
    """Independent outline points per height of specimen [1/m]; 0 without cameras."""
    outline_sigma: float
    """Standard deviation of one of them [m]."""
    clearance: float = 0.0
    """Distance from a platen within which the outline cannot be measured [m]."""

    def __post_init__(self) -> None:
        if not self.window[0] < self.window[1]:
            raise ValueError(f"the window must start before it ends, got {self.window} s")
        for name in ("bin_width", "force_sigma", "frame_interval", "outline_sigma"):
            if not 0.0 < getattr(self, name) < np.inf:
                raise ValueError(f"{name} must be finite and > 0, got {getattr(self, name)}")
        if not 0.0 <= self.points < np.inf:
            raise ValueError(f"points must be finite and >= 0 per m, got {self.points}")
        if not 0.0 <= self.clearance < np.inf:
            raise ValueError(f"clearance must be finite and >= 0 m, got {self.clearance}")
        if self.bin_width > 0.5 * (self.window[1] - self.window[0]):
            raise ValueError(f"bin_width must be at most half the window, got {self.bin_width} s")


def instruments_of(prepared: PreparedShot) -> Instruments:
    """The instruments of the shot itself.

    Without an outline there are no points; their density and sigma are then for the caller to say.
    """
    observations, window = prepared.observations, prepared.forward.shot.window
    edges = observations.bins.edges
    points, sigma, interval, clearance = 0.0, 1e-6, float(np.diff(edges).mean()), 0.0
    if observations.has_shape:
        line = observations.centre_line
        density = []
        for time in observations.frame_times:
            y = line.y[line.time == time]
            if y.size > 1:
                density.append((y.size - 1) / np.ptp(y))
        points = float(np.median(density)) if density else 0.0
        sigma = float(np.median(line.sigma))
        gap = prepared.forward.shot.specimen.length - prepared.path.position(line.time)
        clearance = max(0.0, float(min(line.y.min(), (gap - line.y).min())))
        if observations.frame_times.size > 1:
            interval = float(np.median(np.diff(observations.frame_times)))
    return Instruments(
        window=window,
        bin_width=float(np.diff(edges).mean()),
        force_sigma=float(np.median(observations.bins.sigma)),
        frame_interval=interval,
        points=points,
        outline_sigma=sigma,
        clearance=clearance,
    )
