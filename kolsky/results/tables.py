"""An identification as CSV tables and as one JSON object."""

from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from kolsky.base.files import jsonable, write_table
from kolsky.inverse.parameters import reference_words
from kolsky.inverse.result import Contribution, FitQuality, Identification, worst_imbalance
from kolsky.inverse.run_table import DesignTable
from kolsky.uncertainty.declarations import elasticity, invisible_inputs, relative_moves


def write_csv(folder: Path, identification: Identification) -> list[Path]:
    """Write force.csv, profile.csv, design.csv and energy.csv, units in the headers, each atomically.

    Parameters
    ----------
    folder : Path
        Where to; made if absent.
    identification : Identification
        What is written.

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
        **end_columns(design),
    }
    energy = {"time (s)": result.response.surface_times}
    energy |= {f"{f.name} (J)": getattr(ledger, f.name)[0] for f in fields(ledger)}
    energy |= {"residual (J)": ledger.residual[0]}

    return {"force": force, "profile": profile, "design": runs, "energy": energy}


def end_columns(design: DesignTable) -> dict[str, Any]:
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


def to_json(identification: Identification) -> dict[str, Any]:
    """The result as one object of JSON types.

    Every free parameter is a key with `value`, `interval` (k = 2, inside the range `searched`), `sigma`,
    `sigma_noise`, `sigma_numerical`, `sigma_systematic`, `mesh_shift`, `on_mesh` (the optimum on the refined
    mesh), `mesh_correction` (what `value` adds to it), `noise_parts`, `numerical_parts`, `unit`, `outcome`;
    `fit` and `clocks` are null where they were not recorded; `failed_runs` lists the runs that did not
    complete. Numbers that are not finite become null.

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
        "routes": [{**vars(route), "budget": _budget_json(route.budget)} for route in result.routes],
        "route_difference": None
        if result.route_difference is None
        else {**vars(result.route_difference), "budget": _budget_json(result.route_difference.budget)},
        "methods": [vars(method) for method in result.methods],
        "terms": terms,
        "fixed": result.fixed,
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
        "fit": {channel.channel: _fit_json(channel) for channel in result.fit} or None,
        "clocks": {lag.recording: {**vars(lag), "significance": lag.significance} for lag in result.clocks}
        or None,
        **_findings(result),
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
            "searched": e.searched,
            "sigma": e.sigma,
            "sigma_noise": e.sigma_noise,
            "sigma_numerical": e.sigma_numerical,
            "sigma_systematic": e.sigma_systematic,
            "mesh_shift": e.mesh_shift,
            "on_mesh": e.on_mesh,
            "mesh_correction": e.mesh_correction,
            "noise_parts": e.noise_parts,
            "numerical_parts": e.numerical_parts,
            "unit": e.unit,
            "outcome": e.outcome.value,
        }
        for name, e in result.estimates.items()
    }
    return {key: jsonable(value, key) for key, value in {"shot": result.shot, **estimates, **rest}.items()}


def _budget_json(parts: tuple[Contribution, ...]) -> dict[str, dict[str, float]]:
    """Standard uncertainties by source and parameter."""
    return {part.source: part.sigma for part in parts}


def _fit_json(channel: FitQuality) -> dict[str, Any]:
    """Goodness of fit of a channel, with the ratios that its verdict is made of."""
    ratios = ("expected", "over_noise", "over_peak", "excess", "slow_excess", "explained")
    return {**vars(channel), **{name: getattr(channel, name) for name in ratios}}


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


def _findings(result: Identification) -> dict[str, Any]:
    """Intervals, verdicts and shares beside the estimates, without curves, maps and samples."""
    answer = {name: e.value for name, e in result.estimates.items()}
    posterior = None
    if result.posterior is not None:
        posterior = {name: value for name, value in vars(result.posterior).items() if name != "samples"}
    return {
        "profiles": {
            profile.name: {
                "interval": profile.interval,
                "interval_others_known": profile.alone,
                "level": profile.level,
                "verdict": profile.verdict,
                "text": profile.text,
                "error": profile.error,
            }
            for profile in result.profiles
        },
        "systematic": {
            part.key: {"sigma": part.sigma, "unit": part.unit, "shifts": part.shifts, "status": part.status}
            for part in result.systematic
        },
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
        "variations": [
            {"key": other.key, "value": other.value, "shifts": other.shifts, "status": other.status}
            for other in result.variations
        ],
        "posterior": posterior,
        "held_answer": None if result.held_answer is None else vars(result.held_answer),
        "causes": [
            {**vars(cause), "change": cause.change, "within": cause.within} for cause in result.causes
        ],
    }
