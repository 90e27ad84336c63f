"""Bars without a specimen: the pulse at the far gauge and what is left of it after dispersion."""

from kolsky.bars.guides.bars_together import BarsTogether
from kolsky.report.figures.base import COLUMN, GREY, MEASURED, MODEL, FigureKind, Panels

US, MICRO = 1e6, 1e6


def caption(found: BarsTogether) -> str:
    """What is seen."""
    return (
        "Bars together. Top: strain at the transmission gauge, and the incident gauge's carried there by the "
        f"first mode of Pochhammer and Chree with c₀ = {found.wave_speed:.1f} m/s and gain {found.gain:.4f}. "
        f"Bottom: their difference, {100.0 * found.rms:.2f} % rms of the peak; a plain shift leaves "
        f"{100.0 * found.plain_rms:.2f} %."
    )


def draw(found: BarsTogether, panels: Panels) -> None:
    """Draw both pulses and the residual."""
    top, low = panels["pulse"], panels["residual"]
    time = US * found.time
    top.plot(time, MICRO * found.measured, color=MEASURED, label="measured")
    top.plot(time, MICRO * (found.measured + found.residual), "--", color=MODEL, label="carried there")
    top.set_ylabel("Strain (µm/m)")
    top.legend(loc="best")
    top.tick_params(labelbottom=False)
    low.axhline(0.0, color=GREY, lw=0.5)
    low.plot(time, MICRO * found.residual, color=MODEL, lw=0.7)
    low.set(xlabel="Time (µs)", ylabel="Difference (µm/m)")


KIND: FigureKind[BarsTogether] = FigureKind(
    name="bars-together",
    width=COLUMN,
    height=lambda found: 80.0,
    caption=caption,
    panels=lambda found: [["pulse"], ["residual"]],
    draw=draw,
    mosaic={"sharex": True, "height_ratios": [2.0, 1.0]},
)
