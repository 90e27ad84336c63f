"""Page of measured surfaces: figures, noise floors, outcomes of points, reporting table.

`rows_of_points` and `rows_of_frames` serve the page of a full-field measurement too.
"""

from collections.abc import Mapping
from typing import Any

from dic import output
from dic.outcome import FrameOutcome, PointOutcome
from kolsky.bars.flyer import flight
from kolsky.pictures import summary
from kolsky.pictures.summary import words
from kolsky.report.figures import SURFACES
from kolsky.report.pages.rendering import draw_figures, page_writer, render_page
from kolsky.report.picture_views import SurfaceView


def rows_of_points(counts: Mapping[PointOutcome, int], total: int, **more: Any) -> list[dict[str, Any]]:
    """Return a row an outcome: its words, count, share of `total`, cause and cure, and `more` entries."""
    return [
        {
            **more,
            "outcome": words(outcome),
            "count": count,
            "share": f"{100.0 * count / max(total, 1):.3g} %",
            "cause": outcome.cause,
            "cure": outcome.cure,
            "ok": outcome.ok,
        }
        for outcome, count in sorted(counts.items())
    ]


def rows_of_frames(bad: Mapping[Any, FrameOutcome]) -> list[tuple[str, str, str, str]]:
    """Return the frames that gave no points: number, outcome, cause, cure."""
    return [(str(frame), words(outcome), outcome.cause, outcome.cure) for frame, outcome in bad.items()]


def render(
    shown: SurfaceView,
    inputs: Mapping[str, str],
    *,
    processes: int = 1,
) -> str:
    """Return the page as HTML text; see `write_page`."""
    result = shown.result
    table = output.reporting_table(result)
    return render_page(
        "surfaces.html",
        kind="Surfaces from two series of pictures",
        heading=shown.shot,
        subject="surfaces",
        figures=draw_figures(SURFACES.values(), shown, processes=processes),
        rows=list({**summary.printed(result), **flight.printed(shown.flight)}.items()),
        warnings=[f"{r.name.capitalize()}. {r.text}. Cure: {r.cure}." for r in result.remarks],
        outcomes=_outcomes(shown),
        frames=rows_of_frames(
            {
                frame: FrameOutcome[name.upper().replace(" ", "_")]
                for frame, name in summary.bad_frames(result).items()
            }
        ),
        parts=[
            (part, [row for row in table if row.part == part])
            for part in dict.fromkeys(r.part for r in table)
        ],
        inputs=list(inputs.items()),
        seconds=[(name, f"{value:.3g} s") for name, value in result.seconds.items()],
    )


write_page = page_writer(render)


def _outcomes(shown: SurfaceView) -> list[dict[str, Any]]:
    """Return the outcomes of points by body, with cause and cure."""
    rows = []
    for name, body in (("specimen", shown.result.specimen), ("flyer", shown.result.flyer)):
        if body is not None:
            rows += rows_of_points(body.outcomes(), body.surface.outcome.size, body=name)
    return rows
