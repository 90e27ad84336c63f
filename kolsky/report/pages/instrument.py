"""Numbers of the report's slider over time, as its script reads them."""

import base64
import json
from typing import Any

import numpy as np
from markupsafe import Markup

from kolsky.base.arrays import FloatArray
from kolsky.inverse.result import Identification
from kolsky.shot.recorded import Recorded

MS, MM, UM = 1e3, 1e3, 1e6
_DIGITS = {"time": 5, "length": 4, "residual": 1, "force": 4}
"""Digits behind the point: times [ms], lengths [mm], residuals [µm], forces [N]."""


def instrument(result: Identification, recordings: Recorded | None) -> Markup:
    """The numbers as JSON that may stand inside a page.

    Parameters
    ----------
    result
        The identification, in SI.
    recordings
        Recordings of the shot; their pictures are shown if there are any.
    """
    text = json.dumps(numbers(result, recordings), allow_nan=False, separators=(",", ":"))
    return Markup(text.replace("<", "\\u003c").replace("&", "\\u0026"))  # no end of a script inside it


def numbers(result: Identification, recordings: Recorded | None) -> dict[str, Any]:
    """Force, outlines and pictures in ms, N, mm and µm; None where there is no number."""
    c, response = result.comparison, result.response
    film = None if recordings is None else recordings.film
    return {
        "force": {
            "time": _rounded(MS * c.force_time, "time"),
            "measured": _rounded(c.force_measured, "force"),
            "model": _rounded(c.force_model, "force"),
            "sigma": _rounded(c.force_sigma, "force"),
        },
        "outlines": _outlines(result),
        "simulated": {
            "time": _rounded(MS * response.surface_times, "time"),
            "r": [_rounded(MM * row, "length") for row in response.surface_r[0]],
            "y": [_rounded(MM * row, "length") for row in response.surface_y[0]],
        },
        "pictures": {
            "time": [] if film is None else _rounded(MS * film.time, "time"),
            "jpeg": [] if film is None else [base64.b64encode(data).decode() for data in film.jpeg],
        },
    }


def _outlines(result: Identification) -> list[dict[str, Any]]:
    """The measured outline frame by frame, from the lower end upward."""
    c, line = result.comparison, result.comparison.centre_line
    frames = []
    for number in np.unique(line.frame):
        rows = np.flatnonzero(line.frame == number)
        rows = rows[np.argsort(line.y[rows], kind="stable")]
        frames.append(
            {
                "time": _rounded(MS * line.time[rows[:1]], "time")[0],
                "y": _rounded(MM * line.y[rows], "length"),
                "Z": _rounded(MM * line.Z[rows], "length"),
                "sigma": _rounded(UM * line.sigma[rows], "residual"),
                "residual": _rounded(UM * (c.Z_model[rows] - line.Z[rows]), "residual"),
            }
        )
    return frames


def _rounded(values: FloatArray, kind: str) -> list[float | None]:
    """Numbers with the digits of their kind; None for what is none."""
    return [round(float(x), _DIGITS[kind]) if np.isfinite(x) else None for x in values]
