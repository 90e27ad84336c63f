"""The force channel as it was recorded, with the windows that were used of it."""

from kolsky.report.figures.base import BAND, COLUMN, GREY, MEASURED, MODEL, MS, FigureKind, Panels
from kolsky.shot.recorded import Recorded


def caption(shown: Recorded) -> str:
    """What is seen."""
    if shown.baseline is None:
        return (
            "Force on the specimen from the waves in the transmission bar, every sample; blue: the window "
            "that is simulated and compared. Compression is positive."
        )
    return (
        "Force channel as recorded, every sample, on the shot’s clock; orange: the baseline, which gives "
        "zero (dashed) and noise; blue: the window that is simulated and compared."
    )


def draw(shown: Recorded, panels: Panels) -> None:
    """Draw samples, zero and windows."""
    ax = panels["signal"]
    first, last = (MS * end for end in shown.window)
    ax.axvspan(first, last, color=BAND, alpha=0.2, lw=0.0, label="window")
    if shown.baseline is not None:
        first, last = (MS * end for end in shown.baseline)
        ax.axvspan(first, last, color=MODEL, alpha=0.25, lw=0.0, label="baseline")
        ax.axhline(shown.zero, color=MODEL, lw=0.7, ls="--", label="zero")
    ax.plot(MS * shown.time, shown.value, color=MEASURED, lw=0.4, label="recorded")
    if shown.symmetry_end is not None:
        ax.axvline(MS * shown.symmetry_end, color=GREY, lw=0.8, ls=":", label="end of symmetry")
    ax.set_xlabel("Time $t$ (ms)")
    ax.set_ylabel("Signal (V)" if shown.unit == "V" else f"Force $F$ ({shown.unit})")
    ax.margins(x=0.0)
    ax.legend(loc="upper left")


KIND: FigureKind[Recorded] = FigureKind(
    name="raw-signals",
    width=COLUMN,
    height=lambda shown: 60.0,
    caption=caption,
    panels=lambda shown: [["signal"]],
    draw=draw,
    applies=lambda shown: shown.time.size > 0,
)
