"""What the analyst chose, and what another choice does to the answer where somebody tried."""

from typing import Any

from kolsky.inverse.result import Identification
from kolsky.report import numbers
from kolsky.report.knowntables import INPUTS
from kolsky.report.nomenclature import name_of, route_label

CHOSEN = ("poisson", "damping", "friction")
"""Inputs that no file of the shot measures."""
NOT_VARIED = "not varied"
WINDOW_END, FORCE_BINS = "window_end", "force_bins"
"""Keys of `kolsky.inverse.uncertainty_results.Variation`."""


def choices(result: Identification) -> list[dict[str, Any]]:
    """Rows of the section: the choice, what was taken, the shift of each parameter, what was done.

    Parameters
    ----------
    result
        In shown units.
    """
    return [*_inputs(result), *_window(result), *_data(result), *_mesh(result)]


def _row(
    result: Identification, words: str, taken: str, shifts: dict[str, float], done: str
) -> dict[str, Any]:
    return {
        "words": words,
        "taken": taken,
        "shifts": [
            numbers.part(shifts[name], 2.0 * e.sigma) if name in shifts else numbers.NOTHING
            for name, e in result.estimates.items()
        ],
        "done": done,
    }


def _inputs(result: Identification) -> list[dict[str, Any]]:
    rows = []
    varied = {part.key: part for part in result.systematic}
    for key in CHOSEN:
        part, name = varied.get(key), name_of(key)
        unit = "" if name.unit == "1" else f" {name.unit}"
        held = result.fixed.get(key)
        taken = f"{numbers.plain(held)}{unit}" if held is not None else "free"
        done = NOT_VARIED if part is None else part.status
        if part is not None and part.shifts:
            done = "larger by its declared standard uncertainty"
        shifts = {} if part is None else dict(part.shifts)
        rows.append(_row(result, INPUTS[key], taken, shifts, done))
    return rows


def _window(result: Identification) -> list[dict[str, Any]]:
    c = result.comparison
    rows = []
    tried = {key: [v for v in result.variations if v.key == key] for key in (WINDOW_END, FORCE_BINS)}
    if len(window := result.provenance.get("window_s", [])) == 2:
        end = f"{numbers.rounded(1e3 * float(window[1]), -3)} ms"
        words = "end of the window"
        if not tried[WINDOW_END]:
            rows.append(_row(result, words, end, {}, f"{NOT_VARIED}: set window.end and try"))
        for v in tried[WINDOW_END]:
            other = f"{numbers.rounded(1e3 * v.value, -3)} ms instead"
            rows.append(_row(result, words, end, dict(v.shifts), f"{other}: {v.status}"))
    if c.force_time.size > 1:
        width = 1e6 * float(c.force_time[1] - c.force_time[0])
        taken = f"{c.force_time.size} means over {numbers.plain(width, 3)} µs"
        words = "bins of the force (no other filter)"
        if not tried[FORCE_BINS]:
            rows.append(_row(result, words, taken, {}, NOT_VARIED))
        for v in tried[FORCE_BINS]:
            other = f"{numbers.plain(1e6 * v.value, 3)} µs instead"
            rows.append(_row(result, words, taken, dict(v.shifts), f"{other}: {v.status}"))
    return rows


def _data(result: Identification) -> list[dict[str, Any]]:
    routes = [route for route in result.routes if route.name != "joint"]
    return [
        _row(
            result,
            f"misfit: {route_label(route.name)}",
            "joint χ²",
            {name: route.parameters[name] - e.value for name, e in result.estimates.items()},
            # The paper's cost has its optimum from runs on the surrogate's mesh alone.
            "searched with it alone" + (", on the surrogate’s mesh" if route.name == "paper" else ""),
        )
        for route in routes
        if any(other.name == "joint" for other in result.routes)
    ]


def _mesh(result: Identification) -> list[dict[str, Any]]:
    coarse, fine = ("{} × {}".format(*mesh) for mesh in (result.mesh, result.refined_mesh))
    shifts = {name: -e.mesh_shift for name, e in result.estimates.items()}
    return [_row(result, "mesh, radius × length", fine, shifts, f"{coarse} instead")]
