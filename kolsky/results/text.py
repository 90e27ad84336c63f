"""A result as one JSON object and as CSV tables."""

import math
from collections.abc import Mapping
from dataclasses import fields
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

from kolsky.base.files import write_table
from kolsky.inverse.result import Identification, worst_imbalance
from kolsky.inverse.run_table import DesignTable
from kolsky.results.knowledge import knowledge_json
from kolsky.results.methods import methods_json

__all__ = ["ends", "jsonable", "to_json", "write_csv"]


def to_json(identification: Identification) -> dict[str, Any]:
    """The result as one object of JSON types.

    Every free parameter is a key with `value`, `interval` (k = 2), `sigma`, `sigma_noise`,
    `sigma_numerical`, `sigma_systematic`, `mesh_shift`, `noise_parts`, `numerical_parts`, `unit` and
    `outcome`; `failed_runs` lists the runs that did not complete. Numbers that are not finite become null.

    Raises
    ------
    ValueError
        If a free parameter has the name of another key of the object.
    TypeError
        If provenance holds something JSON cannot say.
    """
    result, response = identification, identification.response
    terms = {**vars(result.terms), "chi2": result.terms.chi2}
    rest = {
        "shot": result.shot,
        "warnings": result.warnings,
        "routes": [vars(route) for route in result.routes],
        "methods": methods_json(result.methods),
        "terms": terms,
        "fixed": result.fixed,
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
        **knowledge_json(result),
        "surrogate": result.surrogate,
        "seconds": result.seconds,
        "provenance": result.provenance,
    }
    clash = sorted(set(rest) & set(result.estimates))
    if clash:
        raise ValueError(f"a free parameter cannot be called {clash[0]!r}: the JSON object has such a key")
    estimates = {
        name: {
            "value": e.value,
            "interval": e.interval,
            "sigma": e.sigma,
            "sigma_noise": e.sigma_noise,
            "sigma_numerical": e.sigma_numerical,
            "sigma_systematic": e.sigma_systematic,
            "mesh_shift": e.mesh_shift,
            "noise_parts": e.noise_parts,
            "numerical_parts": e.numerical_parts,
            "unit": e.unit,
            "outcome": e.outcome.value,
        }
        for name, e in result.estimates.items()
    }
    return {key: jsonable(value, key) for key, value in {"shot": result.shot, **estimates, **rest}.items()}


def failed_runs(design: DesignTable) -> list[dict[str, Any]]:
    """The runs that did not complete: number, stage, parameters, outcome, time, element, place and cure."""
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


def ends(design: DesignTable) -> dict[str, Any]:
    """Columns of a CSV table: the time a run reached and, if it failed, its element and what happened."""
    r, y = design.failed_places.T
    lost = set(design.lost)
    return {
        "end (s)": design.end_times,
        "element": [str(e) if e >= 0 else "" for e in design.failed_elements],
        "element R (m)": [f"{x:.9g}" if np.isfinite(x) else "" for x in r],
        "element Y (m)": [f"{x:.9g}" if np.isfinite(x) else "" for x in y],
        "ending": [design.ending(i).sentence if i in lost else "" for i in range(len(design.points))],
    }


def jsonable(value: Any, where: str) -> Any:
    if isinstance(value, Enum):
        return value.value if isinstance(value.value, str) else value.name
    if isinstance(value, np.ndarray | np.generic):
        return jsonable(value.tolist(), where)
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, Mapping):
        return {str(key): jsonable(item, f"{where}.{key}") for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [jsonable(item, f"{where}[{number}]") for number, item in enumerate(value)]
    raise TypeError(f"{where} is a {type(value).__name__}; JSON has numbers, texts, lists and objects only")


def write_csv(folder: Path, identification: Identification) -> list[Path]:
    """Write force.csv, profile.csv, design.csv and energy.csv, units in the headers, each atomically.

    Parameters
    ----------
    folder : Path
        Where to; made if absent.

    Returns
    -------
    list of Path
        The four files. Values are SI with 9 significant digits; "nan" where there is none.
    """
    named = tables(identification).items()
    return [write_table(Path(folder) / f"{name}.csv", columns) for name, columns in named]


def tables(identification: Identification) -> dict[str, dict[str, Any]]:
    """Force, profile, design and energy as named columns, SI, units in the names."""
    result, comparison, design = identification, identification.comparison, identification.design
    line, ledger = comparison.centre_line, identification.response.energy
    force = {
        "time (s)": comparison.force_time,
        "measured force (N)": comparison.force_measured,
        "sigma (N)": comparison.force_sigma,
        "simulated force (N)": comparison.force_model,
    }
    profile = {
        "frame": line.frame,
        "time (s)": line.time,
        "y (m)": line.y,
        "Z measured (m)": line.Z,
        "sigma Z (m)": line.sigma,
        "Z simulated (m)": comparison.Z_model,
        "inside (0/1)": comparison.inside.astype(np.int64),
    }
    units = {name: estimate.unit for name, estimate in result.estimates.items()}
    runs: dict[str, Any] = {"run": np.arange(len(design.outcomes)), "stage": design.stage}
    runs |= {f"{n} ({units.get(n, 'SI')})": design.points[:, i] for i, n in enumerate(design.names)}
    runs |= {
        "outcome": design.outcomes,
        "Phi_F (N)": design.phi_force,
        "Phi_S (1)": design.phi_shape,
        "chi2 force (1)": design.chi2_force,
        "chi2 shape (1)": design.chi2_shape,
        **ends(design),
    }
    energy = {"time (s)": result.response.surface_times}
    energy |= {f"{f.name} (J)": getattr(ledger, f.name)[0] for f in fields(ledger)}
    energy |= {"residual (J)": ledger.residual[0]}

    return {"force": force, "profile": profile, "design": runs, "energy": energy}
