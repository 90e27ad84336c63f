"""What the analyst chose, and what another choice does to the answer where somebody tried."""

from typing import Any

from kolsky.identification import Identification
from kolsky.report import numbers
from kolsky.report.knowntables import INPUTS
from kolsky.report.nomenclature import name_of, route_label

CHOSEN = ("poisson", "damping", "friction")
"""Inputs that no file of the shot measures."""
NOT_VARIED = "not varied"


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
    if len(window := result.provenance.get("window_s", [])) == 2:
        end = f"{numbers.rounded(1e3 * float(window[1]), -3)} ms"
        rows.append(_row(result, "end of the window", end, {}, f"{NOT_VARIED}: set window.end and try"))
    if c.force_time.size > 1:
        width = 1e6 * float(c.force_time[1] - c.force_time[0])
        taken = f"{c.force_time.size} means over {numbers.plain(width, 3)} µs"
        rows.append(_row(result, "force, filter and bins", taken, {}, f"no filter; bins {NOT_VARIED}"))
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
