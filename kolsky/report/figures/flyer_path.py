"""What moves the front face: measured, fitted, and the part of it that is used."""

from kolsky.report.figures.base import (
    BAND,
    COLUMN,
    GREY,
    MEASURED,
    MM,
    MODEL,
    MS,
    UM,
    FigureKind,
    Panels,
    letter,
)
from kolsky.shot.recorded import Recorded


def caption(shown: Recorded) -> str:
    """What is seen."""
    if shown.motion.is_velocity:
        return (
            "Front face, from the waves in the incident bar. (a) Its fitted displacement, (b) its velocity, "
            "measured and fitted with ±2σ, (c) measured minus fitted velocity. Blue: the window."
        )
    return (
        "Flyer. (a) Displacement toward the specimen at the frames and fitted path, (b) the path’s velocity "
        "with ±2σ, (c) measured minus fitted displacement with the ±2σ of the noise. Blue: the window."
    )


def draw(shown: Recorded, panels: Panels) -> None:
    """Draw displacement, velocity and residual."""
    motion = shown.motion
    first, last = (MS * end for end in shown.window)
    for name, ax in panels.items():
        ax.axvspan(first, last, color=BAND, alpha=0.2, lw=0.0)
        if shown.symmetry_end is not None:
            ax.axvline(MS * shown.symmetry_end, color=GREY, lw=0.8, ls=":", label="end of symmetry")
        letter(ax, {"displacement": "a", "velocity": "b", "residual": "c"}[name])
    time, frames = MS * motion.time, MS * motion.measured_time
    ax, low = panels["velocity"], panels["residual"]
    band = 2.0 * motion.velocity_sigma
    ax.fill_between(time, motion.velocity - band, motion.velocity + band, color=MODEL, alpha=0.35, lw=0.0)
    if motion.is_velocity:
        ax.plot(frames, motion.measured, color=MEASURED, lw=0.4, label="measured")
    ax.plot(time, motion.velocity, color=MODEL, label="fitted")
    ax.set_ylabel("Velocity (m/s)")
    ax = panels["displacement"]
    if not motion.is_velocity:
        ax.errorbar(
            frames,
            MM * motion.measured,
            yerr=2.0 * MM * motion.sigma,
            fmt="o",
            ms=1.4,
            mew=0.0,
            color=MEASURED,
            elinewidth=0.4,
            label="measured",
        )
    ax.plot(time, MM * motion.position, color=MODEL, label="fitted")
    ax.set_ylabel("Displacement (mm)")
    ax.legend(loc="upper left")
    factor, what = (1.0, "Residual (m/s)") if motion.is_velocity else (UM, "Residual (µm)")
    low.fill_between(
        frames, -2.0 * factor * motion.sigma, 2.0 * factor * motion.sigma, color=GREY, alpha=0.25, lw=0.0
    )
    low.plot(frames, factor * motion.residual, "o", ms=1.2, mew=0.0, color=MEASURED)
    low.set(xlabel="Time $t$ (ms)", ylabel=what)
    low.margins(x=0.01)


KIND: FigureKind[Recorded] = FigureKind(
    name="flyer-path",
    width=COLUMN,
    height=lambda shown: 105.0,
    caption=caption,
    panels=lambda shown: [["displacement"], ["velocity"], ["residual"]],
    draw=draw,
    mosaic={"sharex": True, "height_ratios": [1.3, 1.2, 0.8]},
    applies=lambda shown: shown.motion.measured_time.size > 1,
)
