"""Outcomes of points and frames as rows of a page, with cause and cure."""

from collections.abc import Mapping
from typing import Any

from dic.outcome import FrameOutcome, PointOutcome
from kolsky.shot.dic_summary import words


def of_points(counts: Mapping[PointOutcome, int], total: int, **more: Any) -> list[dict[str, Any]]:
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


def of_frames(bad: Mapping[Any, FrameOutcome]) -> list[tuple[str, str, str, str]]:
    """Return the frames that gave no points: number, outcome, cause, cure."""
    return [(str(frame), words(outcome), outcome.cause, outcome.cure) for frame, outcome in bad.items()]
