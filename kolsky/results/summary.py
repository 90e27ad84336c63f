"""A result as one JSON object."""

from typing import Any

from kolsky.base.json_types import jsonable
from kolsky.inverse.result import Identification, worst_imbalance
from kolsky.inverse.run_table import DesignTable
from kolsky.results.knowledge import knowledge_json
from kolsky.results.methods import methods_json


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
