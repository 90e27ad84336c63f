"""Fits, simulations and plans of whole specimens as JSON, CSV and HDF5."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from kolsky.base.files import columns_of, jsonable
from kolsky.base.hdf5 import creating, group, put, put_text
from kolsky.bodies.sheet_fit import FieldFit
from kolsky.bodies.specimen_constants import law_curve
from kolsky.bodies.specimen_fit import Expected, SpecimenFit, cross_table
from kolsky.bodies.specimen_model import AXES
from kolsky.material.reference_curve import curve_columns, curve_table
from kolsky.material.uniaxial import CurveBand

VERSION = 1
"""Version of the layout of the HDF5 file."""
_LARGEST_COMPRESSION = 0.6
"""Largest nominal compressive strain of the written curve. It does not depend on the tests."""


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


def files_of(fits: Sequence[SpecimenFit], inputs: Mapping[str, str]) -> dict[str, Any]:
    """The files of fits beside their tables, for `kolsky.base.files.write_folder`. A text with the lines of a
    shot.toml that name the law's curves belongs to each fit."""
    files: dict[str, Any] = {
        "specimen.json": fits_json(fits, inputs),
        "specimen.h5": lambda path: _write_hdf5(path, fits),
    }
    for found in fits:
        pull, push = largest_strains(found)
        said = (
            "# Use one of the two, with its file in the folder of shot.toml. The tests reached "
            f"{100.0 * pull:.3g} % in tension and {100.0 * push:.3g} % in compression.\n\n"
        )
        lines = [
            curve_table(f"{name}.csv", curve, compression=name.endswith("_compression"))
            for name, curve in _law_curves(found).items()
        ]
        files[f"curves/{found.name}_shot.toml"] = said + "\n".join(lines)
    return files


def tables(*fits: SpecimenFit) -> dict[str, dict[str, Any]]:
    """Constants, forces and the curves of the fitted laws as named columns, SI."""
    curves: dict[str, dict[str, Any]] = {}
    for found in fits:
        for name, curve in _law_curves(found).items():
            curves[f"curves/{name}"] = curve_columns(curve)
    return {
        "constants": columns_of(row for found in fits for row in _constant_rows(found)),
        "forces": columns_of(row for found in fits for row in _force_rows(found)),
        **curves,
    }


def _force_rows(found: SpecimenFit) -> Iterator[dict[str, Any]]:
    for one in found.tests:
        samples = one.test.samples
        for end in range(one.test.model.shape.ends):
            for k in range(len(samples.force)):
                yield {
                    "fit": found.name,
                    "test": one.test.name,
                    "end": AXES[end],
                    "displacement (m)": float(samples.displacement[k, end]),
                    "force measured (N)": float(samples.force[k, end]),
                    "force simulated (N)": float(one.force[k, end]),
                    "95 % of it from the constants, half width (N)": float(one.band[k, end]),
                }


def _constant_rows(found: SpecimenFit) -> Iterator[dict[str, Any]]:
    units = {spec.name: spec.unit for spec in found.constants.specs}
    for one in found.intervals.estimates:
        yield {
            "fit": found.name,
            "constant": one.name,
            "unit": units[one.name],
            "value": one.value,
            "sigma": one.sigma if one.sigma is not None else "",
            "low": one.low if one.low is not None else "",
            "high": one.high if one.high is not None else "",
            "verdict": one.verdict.value,
        }


def largest_strains(found: SpecimenFit) -> tuple[float, float]:
    """Largest pull and push of the fitted tests, divided by the free length between the bonds, both >= 0 [-].
    A shear counts as both."""
    pulls, pushes = [0.0], [0.0]
    for one in found.tests:
        if one.fitted:
            shape = one.test.model.shape
            strain = one.test.samples.displacement / shape.free_length
            sheared = float(np.abs(strain).max()) if shape.load == "shear" else 0.0
            pulls.append(max(float(strain.max()), sheared))
            pushes.append(max(float(-strain.min()), sheared))
    return max(pulls), max(pushes)


def _law_curves(found: SpecimenFit) -> dict[str, CurveBand]:
    """The fitted law as curves of both branches, by the names of their tables."""
    constants, covariance = found.constants, found.intervals.covariance
    pull, push = largest_strains(found)
    tension = law_curve(constants, covariance, branch="tension", largest_strain=pull or push)
    compression = law_curve(constants, covariance, branch="compression", largest_strain=_LARGEST_COMPRESSION)
    return {f"{found.name}_tension": tension, f"{found.name}_compression": compression}


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
    """A plan as one object of JSON types, the most informative choice first."""
    choices = [
        {
            "tests": one.tests,
            "relative_sigma": dict(zip(free, one.relative, strict=True)),
            "correlation": one.correlation,
            "criterion": one.criterion,
            "peak_force_N": one.peak_force,
        }
        for one in found
    ]
    return {"choices": jsonable(choices, "plan")}


def plan_columns(found: Sequence[Expected], free: Sequence[str]) -> dict[str, Any]:
    """A plan as named columns, the most informative choice first."""
    columns: dict[str, Any] = {"tests": [" + ".join(one.tests) for one in found]}
    columns["criterion (1)"] = [one.criterion for one in found]
    for j, name in enumerate(free):
        columns[f"relative sigma of {name} (1)"] = [float(one.relative[j]) for one in found]
    return columns | {"peak force (N)": [one.peak_force for one in found]}


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
        "force_misfit_share": found.force_misfit,
        "force_noise_share": found.force_noise,
        "force_explained": found.force_explained,
        "force_testable": found.force_testable,
        "force_N": {"measured": data.force, "simulated": found.cost.state.force},
        "pad_m": data.pad,
        "relative_sigma_by_displacement_per_m": found.relative_by_displacement,
        "relative_sigma_by_force_per_N": found.relative_by_force,
        "steps": [
            step if isinstance(step, str) else dict(zip(free, step.values, strict=True)) for step in steps
        ],
        "converged": found.converged,
        "simulations": found.simulations,
        "warnings": found.warnings,
    }
    return {key: jsonable(value, key) for key, value in whole.items()}


def field_tables(found: FieldFit, steps: Sequence[FieldFit | str]) -> dict[str, dict[str, Any]]:
    """Tables of a fitted sheet: forces, misfits and the constants of every step fitted alone."""
    data = found.problem.data
    columns: dict[str, Any] = {
        "pad (m)": data.pad,
        "force measured (N)": data.force,
        "force simulated (N)": found.cost.state.force,
        "misfit of the displacements (1)": found.misfit,
        "noise alone (1)": found.noise,
    }
    by_u, by_f = found.relative_by_displacement, found.relative_by_force
    for j, name in enumerate(found.constants.free):
        if steps:
            alone = ["" if isinstance(step, str) else float(step.values[j]) for step in steps]
            columns[f"{name} of the step alone (SI)"] = alone
        columns[f"relative sigma of {name} per displacement noise (1/m)"] = by_u[:, j]
        columns[f"relative sigma of {name} per force noise (1/N)"] = by_f[:, j]
    return {"steps": columns}
