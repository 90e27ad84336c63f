"""Measured and simulated force, and what is left between them."""

from kolsky.inverse.result import Identification
from kolsky.report.figures.base import BAND, COLUMN, GREY, MEASURED, MODEL, MS, FigureKind, Panels


def caption(result: Identification) -> str:
    """What is seen."""
    return (
        "Force on the transmission platen: every recorded sample, means over bins and the simulation at the "
        "optimum (top); simulated minus measured force of each bin with the k = 2 band of the measured noise "
        "(bottom). Compression is positive."
    )


def draw(result: Identification, panels: Panels) -> None:
    """Draw the overlay and the residual."""
    c = result.comparison
    time = MS * c.force_time
    top, low = panels["force"], panels["residual"]
    top.plot(MS * c.recorded.time, c.recorded.force, color=GREY, lw=0.3, alpha=0.6, label="recorded")
    top.plot(time, c.force_measured, "o", color=MEASURED, ms=1.6, mew=0.0, label="bin means")
    top.plot(time, c.force_model, color=MODEL, label="simulated")
    top.set_ylabel("Force $F$ (N)")
    top.legend(loc="upper left")
    top.tick_params(labelbottom=False)

    band = 2.0 * c.force_sigma
    low.fill_between(time, -band, band, color=BAND, alpha=0.4, lw=0.0, label="noise, k = 2")
    low.axhline(0.0, color=GREY, lw=0.5)
    low.plot(time, c.force_model - c.force_measured, color=MODEL, lw=0.8)
    low.set_xlabel("Time $t$ (ms)")
    low.set_ylabel(r"$F_\mathrm{sim} - F_\mathrm{meas}$ (N)")
    low.legend(loc="lower left", ncols=2)
    if time.size > 1:
        half = 0.5 * (time[1] - time[0])
        low.set_xlim(time[0] - half, time[-1] + half)
    low.margins(y=0.25)


KIND = FigureKind(
    name="force",
    width=COLUMN,
    height=lambda result: 80.0,
    caption=caption,
    panels=lambda result: [["force"], ["residual"]],
    draw=draw,
    applies=lambda result: result.comparison.force_time.size > 0,
    mosaic={"sharex": True, "height_ratios": [2.4, 1.0]},
)
