"""The answer of the paper's method as text, JSON and a table of its runs."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from kolsky.base.files import filling, write_table
from kolsky.base.json_types import jsonable
from kolsky.inverse.parameters import MOVED
from kolsky.results.tables import ends
from kolsky.studies.paper_method import CONFIRMED, PaperAnswer, at_bound
from kolsky.studies.paper_surface import FRICTION
from kolsky.studies.sweep import costs

STEM = "paper_method"
"""Name of the files, without their endings."""


def rows(answer: PaperAnswer) -> dict[str, str]:
    """Names and values for a table beside our own answer."""
    span, (coarse, refined) = answer.interval, answer.meshes
    range_ = f"{span.low:.4g} to {span.high:.4g}"
    ends_open = [side for side, open_ in (("below", span.open_low), ("above", span.open_high)) if open_]
    if ends_open:
        range_ += f", open {' and '.join(ends_open)}: the design ends there"
    confirmed = "confirmed" if answer.confirmed else "NOT CONFIRMED"
    force_alone = "" if answer.terms.has_shape else ", of the force alone"
    return {
        "m, paper's method": f"{answer.factor:.4g}, {confirmed} on {refined[0]}x{refined[1]}",
        "m, paper's, interval (M.6-M.8)": range_,
        "m, paper's, before refinement": f"{answer.coarse[MOVED]:.4g} on {coarse[0]}x{coarse[1]}",
        "f, paper's": _friction(answer),
        "Phi, paper's": f"{answer.cost:.4g} +- {answer.delta:.2g}{force_alone}",
    }


def _friction(answer: PaperAnswer) -> str:
    case = "no slip" if answer.friction is None else f"{answer.friction:.3g}"
    if FRICTION not in answer.surfaces[0].fit.box.names or answer.friction_told:
        return case
    return f"{case}, as the data do not tell it"


def warnings(answer: PaperAnswer) -> list[str]:
    """What to know before the paper's answer is used."""
    said = []
    low, high = answer.design
    if at_bound(answer.factor, answer.design):
        said.append(
            f"the paper's method ends at a bound of its design, m = {answer.factor:.4g} in {low:g} to "
            f"{high:g}: give another range with --free {MOVED}=LOW:HIGH"
        )
    elif not answer.confirmed:
        said.append(
            f"the paper's method is not confirmed: the last of {len(answer.checks)} runs on the refined mesh "
            f"still moves m = {answer.factor:.4g} by more than {CONFIRMED:g}"
        )
    if answer.error > answer.delta:
        said.append(
            f"the surface through Phi of the paper's method is wrong by {answer.error:.2g} between its runs "
            f"(leave-one-out), more than the uncertainty of Phi, {answer.delta:.2g}: the valley of Phi is "
            "narrower than the distance of the runs"
        )
    return said


def to_json(answer: PaperAnswer) -> dict[str, Any]:
    """The answer as one JSON object, SI; numbers that are not finite become null."""
    said = {
        "shot": answer.shot,
        "stiffness_factor": answer.factor,
        "interval": [answer.interval.low, answer.interval.high],
        "interval_open": [answer.interval.open_low, answer.interval.open_high],
        "confirmed": answer.confirmed,
        "friction": answer.friction,
        "friction_told": answer.friction_told,
        "before_refinement": answer.coarse,
        "phi": answer.cost,
        "sigma_phi": answer.delta,
        "phi_predicted": answer.predicted,
        "terms": vars(answer.terms),
        "surface_error": answer.error,
        "mesh": list(answer.meshes[0]),
        "refined_mesh": list(answer.meshes[1]),
        "checks": [{**at, "phi": cost} for at, cost in answer.checks],
        "warnings": warnings(answer),
    }
    found: dict[str, Any] = jsonable(said, STEM)
    return found


def write_paper_method(folder: Path, answer: PaperAnswer) -> None:
    """Write paper_method.json and paper_method.csv, a row a run of the designs.

    Raises
    ------
    InputError
        If they cannot be written.
    """
    tables = [surface.runs.table for surface in answer.surfaces]
    meshes = [answer.meshes[0]] * (len(tables) - 1) + [answer.meshes[1]]
    columns: dict[str, Any] = {
        "mesh": [f"{n}x{k}" for (n, k), t in zip(meshes, tables, strict=True) for _ in t.outcomes]
    }
    for name in (FRICTION, MOVED):
        values = [
            t.points[:, t.names.index(name)] if name in t.names else np.full(len(t.points), np.nan)
            for t in tables
        ]
        columns[f"{name} (1)"] = np.concatenate(values)
    columns["outcome"] = [outcome for t in tables for outcome in t.outcomes]
    columns["Phi_F (N)"] = np.concatenate([t.phi_force for t in tables])
    columns["Phi_S (1)"] = np.concatenate([t.phi_shape for t in tables])
    columns["Phi (1)"] = np.concatenate([costs(t) for t in tables])
    ended = [ends(t) for t in tables]
    columns |= {key: [value for one in ended for value in one[key]] for key in ended[0]}
    with filling(folder) as partial:
        write_table(partial / f"{STEM}.csv", columns)
        text = json.dumps(to_json(answer), indent=2, allow_nan=False)
        (partial / f"{STEM}.json").write_text(text, encoding="utf-8")
