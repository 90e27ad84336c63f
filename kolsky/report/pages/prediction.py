"""Page of a planned test."""

from kolsky.prediction.design import Aim, Scan
from kolsky.prediction.output import events_table
from kolsky.prediction.predict import RATE_TO, Numbers, Prediction, doubts
from kolsky.report.figures import PREDICTIONS, SCANS
from kolsky.report.pages.rendering import draw_figures, page_writer, render_page, sentences
from kolsky.results import numbers

WORDS = {
    "flyer_speed": ("flyer after the separation (m/s)", 1.0),
    "start_rate": ("that over the specimen's length (1/s)", 1.0),
    "mean_rate": (f"mean strain rate to {100 * RATE_TO:.0f} % of the largest compression (1/s)", 1.0),
    "largest_strain": ("largest compression (%)", 100.0),
    "peak_force": ("largest transmitted force (N)", 1.0),
    "flight": ("separation to arrest (ms)", 1e3),
    "shaper_strain": ("compression of the shaper (mm)", 1e3),
    "pulse_force": ("largest force on the shaper (kN)", 1e-3),
}
"""The numbers of a test in words, and shown number over SI."""


def render(result: Prediction, scan: Scan | None = None, aim: Aim | None = None) -> str:
    """Return the page as HTML text; see `write_page`."""
    figures = draw_figures(PREDICTIONS.values(), result)
    if scan is not None:
        figures += draw_figures(SCANS.values(), (scan, aim), first=len(figures) + 1)
    table = events_table(result)
    return render_page(
        "prediction.html",
        kind="Planned impact test, predicted",
        heading=result.test.declared.name,
        subject="prediction",
        warnings=sentences(doubts(result)),
        facts=rows(result.numbers),
        aim=[] if aim is None else _aimed(aim),
        events=[
            (name, f"{1e6 * t:.0f}", f"{v:.2f}", f"{100 * e:.1f}", f"{f:.1f}")
            for name, t, v, e, f in zip(*table.values(), strict=True)
        ],
        figures=figures,
    )


write_page = page_writer(render)


def rows(result: Numbers) -> list[tuple[str, str]]:
    """The numbers of a test in words."""
    return [
        (words, numbers.plain(factor * getattr(result, name), 4)) for name, (words, factor) in WORDS.items()
    ]


def _aimed(aim: Aim) -> list[tuple[str, str]]:
    lines = [(key, numbers.plain(value, 4)) for key, value in aim.at.items()]
    for name, value in aim.wanted.items():
        words, factor = WORDS[name]
        given = numbers.plain(factor * getattr(aim.numbers, name), 4)
        lines.append((words, f"{given}, wanted {numbers.plain(factor * value, 4)}"))
    return [*lines, ("reached", "yes" if aim.reached else "no, this is the nearest within the ranges")]
