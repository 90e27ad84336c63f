"""Fits, simulations and plans of whole specimens as JSON, CSV and HDF5."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from kolsky.base.files import jsonable, write_table
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
    tests = sorted({one.test.name for found in fits for one in found.tests})
    table = cross_table(fits, tests)
    whole = {
        "fits": {found.name: _fit(found) for found in fits},
        "rmse_N": {
            found.name: dict(zip(tests, row, strict=True)) for found, row in zip(fits, table, strict=True)
        },
        "inputs": dict(inputs),
    }
    return {key: jsonable(value, key) for key, value in whole.items()}


def _fit(found: SpecimenFit) -> dict[str, Any]:
    said = found.intervals
    return {
        "law": found.constants.law,
        "tests": found.fitted,
        "constants": dict(found.constants.values),
        "estimates": {
            one.name: {
                "value": one.value,
                "sigma": one.sigma,
                "interval_95": [one.low, one.high],
                "verdict": one.verdict,
                "correlated_with": one.partner,
                "correlation": one.correlation,
            }
            for one in said.estimates
        },
        "correlation": said.correlation,
        "chi2": found.found.chi2,
        "degrees_of_freedom": said.degrees,
        "probability": said.probability,
        "explained": said.explained,
        "converged": found.found.converged,
        "ended": found.found.ended,
        "simulations": found.found.simulations,
        "starts": [dict(zip(found.constants.free, start, strict=True)) for start in found.starts],
        "bonds": {
            one.test.name: [
                None if peel is None else {"z": peel.z, "length_m": peel.length, "suspected": peel.suspected}
                for peel in one.debonding
            ]
            for one in found.tests
            if one.debonding
        },
        "warnings": found.warnings,
    }


def write_fits(folder: Path, fits: Sequence[SpecimenFit]) -> None:
    """Write forces.csv, constants.csv, the law's curves and specimen.h5 into a folder."""
    rows: dict[str, list[Any]] = {name: [] for name in _FORCE_COLUMNS}
    constants: dict[str, list[Any]] = {name: [] for name in _CONSTANT_COLUMNS}
    for found in fits:
        for one in found.tests:
            for end in range(one.test.model.shape.ends):
                samples = one.test.samples
                n = len(samples.force)
                columns = (
                    [found.name] * n,
                    [one.test.name] * n,
                    [AXES[end]] * n,
                    samples.displacement[:, end].tolist(),
                    samples.force[:, end].tolist(),
                    one.force[:, end].tolist(),
                    one.band[:, end].tolist(),
                )
                for name, values in zip(_FORCE_COLUMNS, columns, strict=True):
                    rows[name] += values
        units = {spec.name: spec.unit for spec in found.constants.specs}
        for estimate in found.intervals.estimates:
            values = (
                found.name,
                estimate.name,
                units[estimate.name],
                estimate.value,
                estimate.sigma if estimate.sigma is not None else "",
                estimate.low if estimate.low is not None else "",
                estimate.high if estimate.high is not None else "",
                estimate.verdict.value,
            )
            for name, value in zip(_CONSTANT_COLUMNS, values, strict=True):
                constants[name].append(value)
        _write_law(folder / "curves", found)
    write_table(folder / "forces.csv", rows)
    write_table(folder / "constants.csv", constants)
    _write_hdf5(folder / "specimen.h5", fits)


_FORCE_COLUMNS = (
    "fit",
    "test",
    "end",
    "displacement (m)",
    "force measured (N)",
    "force simulated (N)",
    "95 % of it from the constants, half width (N)",
)
_CONSTANT_COLUMNS = ("fit", "constant", "unit", "value", "sigma", "low", "high", "verdict")


def largest_strain(found: SpecimenFit) -> float:
    """Largest stroke of the fitted tests over the free length between the bonds [-]."""
    return max(
        float(one.test.samples.displacement.max())
        / (one.test.model.shape.size[0] - 2.0 * one.test.model.shape.bond)
        for one in found.tests
        if one.fitted
    )


def _write_law(folder: Path, found: SpecimenFit) -> None:
    """Write the fitted law as curves, with the lines of a shot.toml that name them."""
    lines = []
    for branch, end in (("tension", largest_strain(found)), ("compression", _LARGEST_COMPRESSION)):
        curve = law_curve(
            found.constants,
            found.intervals.covariance,
            branch="tension" if branch == "tension" else "compression",
            largest_strain=end,
        )
        name = f"{found.name}_{branch}.csv"
        columns = {"strain": curve.strain, "stress (Pa)": curve.stress}
        columns |= {f"mode {k + 1} (Pa)": mode for k, mode in enumerate(curve.modes)}
        write_table(folder / name, columns)
        lines.append(shot_lines(curve, name))
    said = "# Use one of the two, with its file beside shot.toml. The tests were in tension.\n\n"
    (folder / f"{found.name}_shot.toml").write_text(said + "\n".join(lines), encoding="utf-8")


def _write_hdf5(path: Path, fits: Sequence[SpecimenFit]) -> None:
    with creating(path, format="specimen", version=VERSION) as file:
        for found in fits:
            place = group(file, found.name)
            put_text(place, "law", found.constants.law)
            put_text(place, "free", list(found.constants.free))
            put(place, "constants", found.constants.start, "SI")
            put(place, "covariance", found.intervals.covariance, "SI")
            for one in found.tests:
                own = group(place, one.test.name, "NXdata")
                put(own, "displacement", one.test.samples.displacement, "m")
                put(own, "force", one.test.samples.force, "N")
                put(own, "simulated", one.force, "N")
                put(own, "band", one.band, "N")


def plan_json(found: Sequence[Expected], free: Sequence[str]) -> dict[str, Any]:
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
            for one in found
        ]
    }


def write_plan(folder: Path, found: Sequence[Expected], free: Sequence[str]) -> None:
    """Write plan.csv, the choice that tells most first."""
    columns: dict[str, Any] = {"tests": [" + ".join(one.tests) for one in found]}
    columns["criterion (1)"] = [one.criterion for one in found]
    for j, name in enumerate(free):
        columns[f"relative sigma of {name} (1)"] = [float(one.relative[j]) for one in found]
    columns["peak force (N)"] = [one.peak_force for one in found]
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


def field_json(found: FieldFit, steps: Sequence[FieldFit | str]) -> dict[str, Any]:
    """A fitted sheet as one object of JSON types, SI."""
    free = found.constants.free
    data = found.problem.data
    whole = {
        "law": found.constants.law,
        "kinematics": found.problem.sheet.kinematics,
        "constants": dict(zip(free, found.values, strict=True)),
        "sigma": dict(zip(free, found.sigma, strict=True)),
        "cost": {"displacement_m4": found.cost.displacement, "force_N2": found.cost.force},
        "weight_m4_per_N2": data.weight,
        "sigma_displacement_m": data.sigma_displacement,
        "misfit_share": found.misfit,
        "noise_share": found.noise,
        "adequate": found.adequate,
        "force_N": {"measured": data.force, "simulated": found.cost.state.force},
        "pad_m": data.pad,
        "relative_sigma_by_displacement_per_m": found.relative_by_displacement(1.0),
        "relative_sigma_by_force_per_N": found.relative_by_force(1.0),
        "steps": [
            step if isinstance(step, str) else dict(zip(free, step.values, strict=True)) for step in steps
        ],
        "converged": found.converged,
        "simulations": found.simulations,
        "warnings": found.warnings,
    }
    return {key: jsonable(value, key) for key, value in whole.items()}


def write_field(folder: Path, found: FieldFit, steps: Sequence[FieldFit | str]) -> None:
    """Write steps.csv: forces, misfits and the constants of every step fitted alone."""
    data, free = found.problem.data, found.constants.free
    columns: dict[str, Any] = {
        "pad (m)": data.pad,
        "force measured (N)": data.force,
        "force simulated (N)": found.cost.state.force,
        "misfit of the displacements (1)": found.misfit,
        "noise alone (1)": found.noise,
    }
    by_u, by_f = found.relative_by_displacement(1.0), found.relative_by_force(1.0)
    for j, name in enumerate(free):
        alone = [np.nan if isinstance(step, str) else float(step.values[j]) for step in steps]
        columns[f"{name} of the step alone (SI)"] = ["" if np.isnan(value) else value for value in alone]
        columns[f"relative sigma of {name} per displacement noise (1/m)"] = by_u[:, j]
        columns[f"relative sigma of {name} per force noise (1/N)"] = by_f[:, j]
    if not steps:
        columns = {key: value for key, value in columns.items() if "step alone" not in key}
    write_table(folder / "steps.csv", columns)


def write_map(path: Path, found: StiffnessMap, mesh: Mesh) -> None:
    """Write the factor of stiffness of each block with its middle."""
    middle = mesh.points[mesh.cells].mean(axis=1)
    places = np.array([middle[found.regions == r].mean(axis=0) for r in range(len(found.factors))])
    columns = {
        "x (m)": places[:, 0],
        "y (m)": places[:, 1],
        "stiffness over the fitted one (1)": found.factors,
    }
    write_table(path, columns)
