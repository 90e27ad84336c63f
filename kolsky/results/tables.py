"""An identification as CSV tables and as one JSON object."""

from dataclasses import fields
from typing import Any

import numpy as np

from kolsky.base.files import jsonable
from kolsky.inverse.parameters import reference_words
from kolsky.inverse.result import Identification, worst_imbalance
from kolsky.inverse.run_table import DesignTable
from kolsky.results.hdf5 import COMPARISON, DESIGN, ESTIMATE, IDENTIFICATION
from kolsky.uncertainty.declarations import elasticity, invisible_inputs, relative_moves


def tables(identification: Identification) -> dict[str, dict[str, Any]]:
    """Force, profile, design and energy as named columns, SI, units in the names."""
    result, comparison, design = identification, identification.comparison, identification.design
    ledger = result.response.energy
    units = {name: estimate.unit for name, estimate in result.estimates.items()}
    runs: dict[str, Any] = {"run": np.arange(len(design.outcomes)), "stage": design.stage}
    runs |= {f"{n} ({units.get(n, 'SI')})": design.points[:, i] for i, n in enumerate(design.names)}
    runs |= DESIGN.table(design, "runs") | end_columns(design)
    energy = {"time (s)": result.response.surface_times}
    energy |= {f"{f.name} (J)": getattr(ledger, f.name)[0] for f in fields(ledger)}
    energy |= {"residual (J)": ledger.residual[0]}
    return {
        "force": COMPARISON.table(comparison, "bins"),
        "profile": {"frame": comparison.centre_line.frame, **COMPARISON.table(comparison, "points")},
        "design": runs,
        "energy": energy,
    }


def all_tables(found: Identification) -> dict[str, dict[str, Any]]:
    """Estimates, routes and the `tables` as named columns, SI."""
    routes, names = found.routes, list(found.estimates)
    return {
        "estimates": ESTIMATE.columns(found.estimates.values()),
        "routes": {
            "route": [route.name for route in routes],
            **{name: [route.parameters[name] for route in routes] for name in names},
            **{f"sigma {name}": [route.sigma.get(name, float("nan")) for route in routes] for name in names},
            "cost": [route.cost for route in routes],
        },
        **tables(found),
    }


def summary_row(found: Identification, nominal_rate: float) -> dict[str, list[Any]]:
    """Value, U (k = 2) and verdict of each free parameter as one row of a table of many shots, SI.

    ``nominal_rate``: nominal strain rate [1/s]; NaN if unknown.
    """
    row: dict[str, Any] = {"shot": found.shot, "nominal strain rate (1/s)": nominal_rate}
    for name, e in found.estimates.items():
        row |= {f"{name} ({e.unit})": e.value, f"U {name} ({e.unit})": 2.0 * e.sigma}
        row[f"verdict {name}"] = e.outcome.value
    return {name: [value] for name, value in row.items()}


def end_columns(design: DesignTable) -> dict[str, Any]:
    """Columns of a CSV table: the last time of a run and, for a failed run, the element and the reason."""
    r, y = design.failed_places.T
    lost = set(design.lost)
    return {
        "end (s)": design.end_times,
        "element": [int(e) if e >= 0 else "" for e in design.failed_elements],
        "element R (m)": [float(x) if np.isfinite(x) else "" for x in r],
        "element Y (m)": [float(x) if np.isfinite(x) else "" for x in y],
        "ending": [design.ending(i).sentence if i in lost else "" for i in range(len(design.points))],
    }


def to_json(identification: Identification) -> dict[str, Any]:
    """The result as one object of JSON types, with a key for every free parameter, see docs/howto/json.md.

    Numbers that are not finite become null. Raises ValueError if a free parameter has the name of another key
    of the object, and TypeError if provenance contains a value that JSON cannot represent.
    """
    result, response = identification, identification.response
    answer = {name: e.value for name, e in result.estimates.items()}
    said = IDENTIFICATION.json(result)
    rest = {
        **said,
        "fit": said["fit"] or None,
        "clocks": said["clocks"] or None,
        "reference_curve": reference_words((*result.estimates, *result.fixed)) or "the quasi-static curve",
        "mesh": {"default": result.mesh, "refined": result.refined_mesh},
        "check_run": {
            "outcome": [outcome.name for outcome in response.outcomes],
            "ending": [ending.sentence for ending in response.endings],
            "steps": response.steps,
            "smallest_step": response.smallest_step,
            "extrapolated_share": response.extrapolated_share,
            "energy_imbalance": worst_imbalance(response),
        },
        "failed_runs": failed_runs(result.design),
        "sensitivities": {
            part.key: {
                "amount": part.amount,
                "unit": part.unit,
                "relative_moves": relative_moves(part, answer),
                "logarithmic_derivatives": elasticity(part, answer),
                "visible_share": part.visible,
                "alike": list(part.alike),
                "declared": part.status,
            }
            for part in result.systematic
            if part.moves
        },
        "unseen": list(invisible_inputs(result.systematic)),
    }
    clash = sorted(set(rest) & set(result.estimates))
    if clash:
        raise ValueError(f"a free parameter cannot be called {clash[0]!r}: the JSON object has such a key")
    estimates = {name: ESTIMATE.json(e) for name, e in result.estimates.items()}
    return {key: jsonable(value, key) for key, value in {"shot": result.shot, **estimates, **rest}.items()}


def failed_runs(design: DesignTable) -> list[dict[str, Any]]:
    """The failed runs: number, stage, parameters, outcome, time, element, place and remedy."""
    rows = []
    for i in design.lost:
        ending = design.ending(i)
        rows.append(
            {
                "run": i,
                "stage": design.stage[i],
                "parameters": dict(zip(design.names, design.points[i], strict=True)),
                "outcome": ending.outcome.name,
                "end_time": ending.time,
                "element": ending.element,
                "place": ending.place,
                "ending": ending.sentence,
            }
        )
    return rows
