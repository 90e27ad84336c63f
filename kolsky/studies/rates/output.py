"""A rate report to its files: CSV tables, and one HDF5 file with the same columns under the same names."""

import re
from pathlib import Path
from typing import Any

from kolsky.base.files import write_table
from kolsky.base.hdf5 import Format, OpenGroup, group, put, put_text, writing
from kolsky.base.json_types import jsonable
from kolsky.studies.rates.records import GroupRates, RateReport
from kolsky.studies.rates.tables import Columns, tables

FORMAT = Format("kolsky-rates")
_UNIT = re.compile(r" \(([^()]*)\)$")


def write_csv(folder: Path, report: RateReport) -> None:
    """Write rate_*.csv, a file a table."""
    for name, columns in tables(report).items():
        write_table(folder / f"{name}.csv", columns)


def write_hdf5(path: Path, report: RateReport) -> None:
    """Write every table to one HDF5 file, atomically: a group a table, a dataset a column.

    Stress-strain and outline data of the shots stay in their own results.

    Raises
    ------
    OSError
        If the file cannot be written; an older one is then unchanged.
    """
    with writing(path, FORMAT) as place:
        about = {"grouped_by": report.grouped_by, "shared_relative_uncertainty": report.shared}
        entry = group(place.file, place.path, "NXentry", **about)
        for name, columns in tables(report).items():
            _write(group(entry, name.removeprefix("rate_")), columns)


def _write(table: OpenGroup, columns: Columns) -> None:
    for heading, cells in columns.items():
        unit = _UNIT.search(heading)
        # A slash would open a group inside the group.
        name = (heading[: unit.start()] if unit else heading).replace("/", "_")
        if cells and isinstance(cells[0], str):
            put_text(table, name, cells, escape=True)
        else:
            put(table, name, cells, unit[1] if unit else "1")


def summary(report: RateReport) -> dict[str, Any]:
    """The report as one object of JSON types; numbers that are not finite become null."""
    said = {
        "grouped_by": report.grouped_by,
        "shared_relative_uncertainty": report.shared,
        "groups": [_group(group) for group in report.groups],
    }
    return {key: jsonable(value, key) for key, value in said.items()}


def _group(group: GroupRates) -> dict[str, Any]:
    p, line = group.pooled, group.slope
    found: dict[str, Any] = {
        "name": group.name,
        "shots": [
            {
                "name": shot.name,
                "strain_rate": shot.history.nominal_rate,
                "true_strain_rate": shot.history.true_rate,
                "m": shot.m,
                "sigma": shot.sigma,
                "sigma_own": shot.sigma_own,
                "verdict": shot.verdict.value,
                "counted": shot.counted,
                "residual_over_expected": {c: shot.excess(c) for c in ("force", "outline")},
                "phi_force": shot.found.terms.phi_force,
                "phi_shape": shot.found.terms.phi_shape,
            }
            for shot in group.shots
        ],
        "remarks": group.remarks,
    }
    if p is not None:
        found["mean"] = {
            "value": p.mean,
            "interval_95": p.interval,
            "sigma": p.sigma,
            "sigma_shared": p.sigma_common,
            "scatter_between_shots": p.fit.between,
            "two_standard_deviations": 2.0 * p.scatter,
            "Q": p.fit.q,
            "I_squared": p.fit.i_squared,
            "prediction_95": p.prediction,
        }
    if line is not None:
        found["slope"] = {
            "verdict": line.verdict.value,
            "reasons": line.reasons,
            "span_decades": line.span,
            **(
                {}
                if line.fit is None
                else {"per_decade": line.fit.coefficients[1], "interval_95": line.fit.interval(1)}
            ),
        }
    if group.long_lever is not None:
        found["from_quasi_static"] = vars(group.long_lever)
    return found
