"""Fits, simulations and plans of whole specimens as JSON, CSV and HDF5."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from kolsky.base.files import jsonable, write_rows, write_table
from kolsky.base.hdf5 import creating, group, put, put_text
from kolsky.bodies.sheet_fit import FieldFit
from kolsky.bodies.specimen_constants import law_curve, shot_lines
from kolsky.bodies.specimen_fit import SpecimenFit
from kolsky.bodies.specimen_model import AXES
from kolsky.bodies.specimen_studies import Expected, StudyRow, cross_table
from kolsky.bodies.stiffness_map import StiffnessMap
from kolsky.equilibrium.meshes import Mesh

VERSION = 1
"""Of the HDF5 file's layout."""
_LARGEST_COMPRESSION = 0.6
"""Nominal strain to which the curve is written in compression, whatever the tests reached."""


def fits_json(fits: Sequence[SpecimenFit], inputs: Mapping[str, str]) -> dict[str, Any]:
    """Fits as one object of JSON types, SI."""
    tests = sorted({one.test.name for fit in fits for one in fit.tests})
    table = cross_table(fits, tests)
    whole = {
        "fits": {fit.name: _fit(fit) for fit in fits},
        "rmse_N": {
            fit.name: dict(zip(tests, row, strict=True)) for fit, row in zip(fits, table, strict=True)
        },
        "inputs": dict(inputs),
    }
    return {key: jsonable(value, key) for key, value in whole.items()}


def _fit(fit: SpecimenFit) -> dict[str, Any]:
    intervals = fit.intervals
    return {
        "law": fit.constants.law,
        "tests": fit.fitted,
        "constants": dict(fit.constants.values),
        "estimates": {
            one.name: {
                "value": one.value,
                "sigma": one.sigma,
                "interval_95": [one.low, one.high],
                "verdict": one.verdict,
                "correlated_with": one.partner,
                "correlation": one.correlation,
            }
            for one in intervals.estimates
        },
        "correlation": intervals.correlation,
        "chi2": fit.found.chi2,
        "degrees_of_freedom": intervals.degrees,
        "probability": intervals.probability,
        "explained": intervals.explained,
        "converged": fit.found.converged,
        "ended": fit.found.ended,
        "simulations": fit.found.simulations,
        "starts": [dict(zip(fit.constants.free, start, strict=True)) for start in fit.starts],
        "bonds": {
            one.test.name: [
                None if peel is None else {"z": peel.z, "length_m": peel.length, "suspected": peel.suspected}
                for peel in one.debonding
            ]
            for one in fit.tests
            if one.debonding
        },
        "warnings": fit.warnings,
    }


def write_fits(folder: Path, fits: Sequence[SpecimenFit]) -> None:
    """Write forces.csv, constants.csv, the law's curves and specimen.h5 into a folder."""
    forces: list[dict[str, Any]] = []
    constants: list[dict[str, Any]] = []
    for fit in fits:
        for one in fit.tests:
            samples = one.test.samples
            forces += [
                {
                    "fit": fit.name,
                    "test": one.test.name,
                    "end": AXES[end],
                    "displacement (m)": float(samples.displacement[k, end]),
                    "force measured (N)": float(samples.force[k, end]),
                    "force simulated (N)": float(one.force[k, end]),
                    "95 % of it from the constants, half width (N)": float(one.band[k, end]),
                }
                for end in range(one.test.model.shape.ends)
                for k in range(len(samples.force))
            ]
        units = {spec.name: spec.unit for spec in fit.constants.specs}
        constants += [
            {
                "fit": fit.name,
                "constant": one.name,
                "unit": units[one.name],
                "value": one.value,
                **{
                    name: "" if value is None else value
                    for name, value in (("sigma", one.sigma), ("low", one.low), ("high", one.high))
                },
                "verdict": one.verdict.value,
            }
            for one in fit.intervals.estimates
        ]
        _write_law(folder / "curves", fit)
    write_rows(folder / "forces.csv", forces)
    write_rows(folder / "constants.csv", constants)
    _write_hdf5(folder / "specimen.h5", fits)


def largest_strain(fit: SpecimenFit) -> float:
    """Largest stroke of the fitted tests over the free length between the bonds [-]."""
    return max(
        float(one.test.samples.displacement.max())
        / (one.test.model.shape.size[0] - 2.0 * one.test.model.shape.bond)
        for one in fit.tests
        if one.fitted
    )


def _write_law(folder: Path, fit: SpecimenFit) -> None:
    """Write the fitted law as curves, with the lines of a shot.toml that name them."""
    lines = []
    for branch, end in (("tension", largest_strain(fit)), ("compression", _LARGEST_COMPRESSION)):
        curve = law_curve(
            fit.constants,
            fit.intervals.covariance,
            branch="tension" if branch == "tension" else "compression",
            largest_strain=end,
        )
        name = f"{fit.name}_{branch}.csv"
        columns = {"strain": curve.strain, "stress (Pa)": curve.stress}
        columns |= {f"mode {k + 1} (Pa)": mode for k, mode in enumerate(curve.modes)}
        write_table(folder / name, columns)
        lines.append(shot_lines(curve, name))
    remark = "# Use one of the two, with its file beside shot.toml. The tests were in tension.\n\n"
    (folder / f"{fit.name}_shot.toml").write_text(remark + "\n".join(lines), encoding="utf-8")


def _write_hdf5(path: Path, fits: Sequence[SpecimenFit]) -> None:
    with creating(path, format="specimen", version=VERSION) as file:
        for fit in fits:
            place = group(file, fit.name)
            put_text(place, "law", fit.constants.law)
            put_text(place, "free", list(fit.constants.free))
            put(place, "constants", fit.constants.start, "SI")
            put(place, "covariance", fit.intervals.covariance, "SI")
            for one in fit.tests:
                own = group(place, one.test.name, "NXdata")
                put(own, "displacement", one.test.samples.displacement, "m")
                put(own, "force", one.test.samples.force, "N")
                put(own, "simulated", one.force, "N")
                put(own, "band", one.band, "N")


def plan_json(choices: Sequence[Expected], free: Sequence[str]) -> dict[str, Any]:
    """A plan as one object of JSON types, the choice that tells most first."""
    return {
        "choices": [
            jsonable(
                {
                    "tests": one.tests,
                    "relative_sigma": dict(zip(free, one.relative, strict=True)),
                    "correlation": one.correlation,
                    "criterion": one.criterion,
                    "peak_force_N": one.peak_force,
                },
                "plan",
            )
            for one in choices
        ]
    }


def write_plan(folder: Path, choices: Sequence[Expected], free: Sequence[str]) -> None:
    """Write plan.csv, the choice that tells most first."""
    columns: dict[str, Any] = {"tests": [" + ".join(one.tests) for one in choices]}
    columns["criterion (1)"] = [one.criterion for one in choices]
    for j, name in enumerate(free):
        columns[f"relative sigma of {name} (1)"] = [float(one.relative[j]) for one in choices]
    columns["peak force (N)"] = [one.peak_force for one in choices]
    write_table(folder / "plan.csv", columns)


def write_study(path: Path, rows: Sequence[StudyRow]) -> None:
    """Write the fits of a study as one table."""
    names = list(dict.fromkeys(name for row in rows for name in row.values))
    columns: dict[str, Any] = {"case": [row.label for row in rows]}
    columns |= {f"{name} (SI)": [row.values.get(name, "") for row in rows] for name in names}
    columns |= {
        "RMSE (N)": [row.rmse for row in rows],
        "displacement components": [row.unknowns for row in rows],
        "simulations": [row.simulations for row in rows],
    }
    write_table(path, columns)


def field_json(fit: FieldFit, steps: Sequence[FieldFit | str]) -> dict[str, Any]:
    """A fitted sheet as one object of JSON types, SI."""
    free = fit.constants.free
    data = fit.problem.data
    whole = {
        "law": fit.constants.law,
        "kinematics": fit.problem.sheet.kinematics,
        "constants": dict(zip(free, fit.values, strict=True)),
        "sigma": dict(zip(free, fit.sigma, strict=True)),
        "cost": {"displacement_m4": fit.cost.displacement, "force_N2": fit.cost.force},
        "weight_m4_per_N2": data.weight,
        "sigma_displacement_m": data.sigma_displacement,
        "misfit_share": fit.misfit,
        "noise_share": fit.noise,
        "adequate": fit.adequate,
        "force_N": {"measured": data.force, "simulated": fit.cost.state.force},
        "pad_m": data.pad,
        "relative_sigma_by_displacement_per_m": fit.relative_by_displacement(1.0),
        "relative_sigma_by_force_per_N": fit.relative_by_force(1.0),
        "steps": [
            step if isinstance(step, str) else dict(zip(free, step.values, strict=True)) for step in steps
        ],
        "converged": fit.converged,
        "simulations": fit.simulations,
        "warnings": fit.warnings,
    }
    return {key: jsonable(value, key) for key, value in whole.items()}


def write_field(folder: Path, fit: FieldFit, steps: Sequence[FieldFit | str]) -> None:
    """Write steps.csv: forces, misfits and the constants of every step fitted alone."""
    data, free = fit.problem.data, fit.constants.free
    columns: dict[str, Any] = {
        "pad (m)": data.pad,
        "force measured (N)": data.force,
        "force simulated (N)": fit.cost.state.force,
        "misfit of the displacements (1)": fit.misfit,
        "noise alone (1)": fit.noise,
    }
    by_u, by_f = fit.relative_by_displacement(1.0), fit.relative_by_force(1.0)
    for j, name in enumerate(free):
        of_step = [np.nan if isinstance(step, str) else float(step.values[j]) for step in steps]
        columns[f"{name} of the step alone (SI)"] = ["" if np.isnan(value) else value for value in of_step]
        columns[f"relative sigma of {name} per displacement noise (1/m)"] = by_u[:, j]
        columns[f"relative sigma of {name} per force noise (1/N)"] = by_f[:, j]
    if not steps:
        columns = {key: value for key, value in columns.items() if "step alone" not in key}
    write_table(folder / "steps.csv", columns)


def write_map(path: Path, stiffness: StiffnessMap, mesh: Mesh) -> None:
    """Write the factor of stiffness of each block with its middle."""
    middle = mesh.points[mesh.cells].mean(axis=1)
    places = np.array([middle[stiffness.regions == r].mean(axis=0) for r in range(len(stiffness.factors))])
    columns = {
        "x (m)": places[:, 0],
        "y (m)": places[:, 1],
        "stiffness over the fitted one (1)": stiffness.factors,
    }
    write_table(path, columns)
