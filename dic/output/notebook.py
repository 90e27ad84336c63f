"""A measured surface in a notebook, and as a table of pandas or xarray."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dic.outcome import PointOutcome
from dic.surfaces.surface_history import SurfaceHistory

COMPONENTS = ("x", "y", "Z")
"""Names of the last axis of positions."""


CURE = "pip install 'kolsky[notebook]'"


def pandas() -> Any:
    """The package pandas.

    Raises
    ------
    ImportError
        If it is not installed; the message says how to get it.
    """
    try:
        import pandas
    except ImportError:
        raise ImportError(f"this needs pandas: {CURE}") from None
    return pandas


def xarray() -> Any:
    """The package xarray.

    Raises
    ------
    ImportError
        If it is not installed; the message says how to get it.
    """
    try:
        import xarray
    except ImportError:
        raise ImportError(f"this needs xarray: {CURE}") from None
    return xarray


def html_table(caption: str, rows: list[tuple[str, str]]) -> str:
    """Names and values as an HTML table, every text escaped."""
    from html import escape

    left = ' style="text-align:left"'
    body = "".join(
        f"<tr><th{left}>{escape(name)}</th><td{left}>{escape(value)}</td></tr>" for name, value in rows
    )
    return f"<table><caption>{escape(caption)}</caption><tbody>{body}</tbody></table>"


def facts(surface: SurfaceHistory) -> list[tuple[str, str]]:
    """Summary of a surface: frames, points, times, outcomes, sigma."""
    rows = [
        ("frames", str(surface.n_frames)),
        ("points", str(surface.n_points)),
    ]
    if surface.n_frames:
        rows.append(("time", f"{1e3 * surface.t[0]:.6g} to {1e3 * surface.t[-1]:.6g} ms"))
    total = surface.outcome.size
    for value, count in zip(*np.unique(surface.outcome, return_counts=True), strict=True):
        name = PointOutcome(value).name.lower().replace("_", " ")
        rows.append((name, f"{count} ({100.0 * count / total:.3g} %)"))
    if surface.valid.any():
        median = np.median(surface.sigma[surface.valid], axis=0)
        said = ", ".join(f"{name} {1e6 * value:.3g}" for name, value in zip(COMPONENTS, median, strict=True))
        rows.append(("median standard deviation (µm)", said))
    return rows


def to_dataframe(surface: SurfaceHistory) -> Any:
    """A row a point of a frame: time [s], reference X [m], displacement u [m], sigma [m], outcome."""
    frame, point = np.indices(surface.outcome.shape)
    columns: dict[str, NDArray[Any]] = {
        "frame": frame.ravel(),
        "point": point.ravel(),
        "t (s)": surface.t[frame].ravel(),
    }
    for k, name in enumerate(COMPONENTS):
        columns[f"X_{name} (m)"] = surface.X[point, k].ravel()
    valid = surface.valid
    for symbol, values in (("u", surface.u), ("sigma", surface.sigma)):
        for k, name in enumerate(COMPONENTS):
            columns[f"{symbol}_{name} (m)"] = np.where(valid, values[..., k], np.nan).ravel()
    names = np.array([""] * (max(map(int, PointOutcome)) + 1), dtype=object)
    for outcome in PointOutcome:
        names[int(outcome)] = outcome.name.lower()
    columns["outcome"] = names[surface.outcome.ravel()]
    return pandas().DataFrame(columns)


def to_xarray(surface: SurfaceHistory) -> Any:
    """Frames x points x components with coordinates; lost points are NaN, `outcome` says why."""
    valid = surface.valid[..., None]
    dims = ("frame", "point", "component")
    return xarray().Dataset(
        {
            "u": (dims, np.where(valid, surface.u, np.nan), {"units": "m"}),
            "sigma": (dims, np.where(valid, surface.sigma, np.nan), {"units": "m"}),
            "outcome": (dims[:2], surface.outcome, {"meaning": ", ".join(map(repr, PointOutcome))}),
        },
        coords={
            "t": ("frame", surface.t, {"units": "s"}),
            "X": (dims[1:], surface.X, {"units": "m"}),
            "component": list(COMPONENTS),
        },
    )
