"""Files of quasi-static tests, and a reference curve as tables, as the table of a shot.toml and as JSON."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from kolsky.base.apparatus import Specimen
from kolsky.base.errors import InputError
from kolsky.base.files import write_table
from kolsky.material.curves.band import apparent_modulus
from kolsky.material.curves.uniaxial import UniaxialTest
from kolsky.material.end_friction.problem import ModelFit
from kolsky.material.reference_curve import ReferenceCurve
from kolsky.readers.columns import read_columns

CONVENTIONS = ("tension-positive", "compression-positive")
"""Signs that the columns of a file may have."""
BRANCHES = ("compression", "tension")
"""Halves of the curve."""
COLUMNS = {"strain": "1", "stress": "Pa", "displacement": "m", "force": "N", "time": "s", "bulge": "m"}
"""Quantity of a column -> its SI unit."""

MODE = "mode"
"""First word of the headings of common uncertainties."""


def read_uniaxial_test(
    path: str | Path,
    columns: Mapping[str, str],
    *,
    convention: str,
    branch: str,
    units: Mapping[str, str] | None = None,
    header_line: int | None = None,
    specimen: Specimen | None = None,
) -> tuple[UniaxialTest, str]:
    """Read a quasi-static test, positive along its branch, and the SHA-256 of its file.

    Parameters
    ----------
    path
        The file.
    columns
        Kind of `COLUMNS` -> column, by name or number: strain and stress, or displacement and force.
    convention
        Sign of the columns, one of `CONVENTIONS`.
    branch
        One of `BRANCHES`.
    units
        Column -> unit, where the file does not say it.
    header_line
        Line of the column names; found if None, 0 for none.
    specimen
        Undeformed size; needed for displacement and force.

    Raises
    ------
    InputError
        If the file cannot be read, or its columns are no such test.
    """
    path = Path(path)
    values, digest = read_columns(
        path,
        {what: (column, COLUMNS[what]) for what, column in columns.items()},
        units=dict(units or {}),
        header_line=header_line,
    )
    compression = branch == "compression"
    sign = 1.0 if compression == (convention == "compression-positive") else -1.0
    if specimen is not None and "force" in columns:
        values["strain"] = values["displacement"] / specimen.length
        values["stress"] = values["force"] / specimen.area
    try:
        test = UniaxialTest(
            name=path.name,
            strain=sign * values["strain"],
            stress=sign * values["stress"],
            compression=compression,
            time=values.get("time"),
            bulge=values.get("bulge"),
        )
    except ValueError as error:
        raise InputError(path, str(error), cure="are column, unit, branch and convention right?") from None
    return test, digest


def write_curve(path: Path, made: ReferenceCurve) -> None:
    """Write a table that `[curve]` of a shot.toml reads, strain and stress positive along the branch."""
    band = made.band
    modes = {
        f"{MODE} {number}: {name} (Pa)": row.tolist()
        for number, (name, row) in enumerate(zip(band.names, band.modes, strict=True), start=1)
    }
    write_table(
        path,
        {
            "nominal strain (1)": band.strain.tolist(),
            "nominal stress (Pa)": band.stress.tolist(),
            "independent sigma (Pa)": band.noise.tolist(),
            **modes,
        },
    )


def write_modulus(path: Path, made: ReferenceCurve) -> None:
    """Write E_a over strain and time with its k = 2 interval, and that of the uncorrected curve."""
    modulus = made.modulus
    low, high = modulus.interval()
    apparent = apparent_modulus(made.apparent, compression=made.compression)
    time = {} if modulus.time is None else {"time since zero strain (s)": modulus.time.tolist()}
    write_table(
        path,
        {
            "nominal strain (1)": modulus.strain.tolist(),
            **time,
            "E_a (Pa)": modulus.modulus.tolist(),
            "low end, k = 2 (Pa)": low.tolist(),
            "high end, k = 2 (Pa)": high.tolist(),
            "E_a as if frictionless (Pa)": apparent.modulus.tolist(),
        },
    )


def curve_table(name: str, made: ReferenceCurve, conditioned: str | None) -> str:
    """The table `[curve]` for a shot.toml that reads the curve."""
    side = "compression" if made.compression else "tension"
    lines = [
        "[curve]",
        f'file = "{name}"',
        'strain = { column = "nominal strain (1)", unit = "1" }',
        'stress = { column = "nominal stress (Pa)", unit = "Pa" }',
        f'convention = "{side} positive"',
        f'branch = "{side}"',
        'sigma = { column = "independent sigma (Pa)", unit = "Pa" }',
        *([f'modes = {{ prefix = "{MODE} ", unit = "Pa" }}'] if made.band.names else []),
        *([] if conditioned is None else [f'conditioned = "{conditioned}"']),
    ]
    return "\n".join(lines) + "\n"


def summary(made: ReferenceCurve) -> dict[str, Any]:
    """Numbers of a reference curve for JSON, SI."""
    modulus, friction = made.modulus, made.friction
    parts = {name: float(np.max(part / made.band.stress)) for name, part in made.band.parts().items()}
    return {
        "tests": len(made.tests),
        "strain_range": [float(made.band.strain[0]), float(made.band.strain[-1])],
        "mean_E_a": {"value": modulus.mean, "sigma": modulus.mean_sigma, "unit": "Pa"},
        "zero_of_strain": [one.offset for one in made.tests],
        "largest_relative_sigma": parts,
        "friction": None
        if friction is None
        else {
            "coefficient": friction.coefficient,
            "sigma": friction.sigma,
            "ratio": [float(friction.ratio.min()), float(friction.ratio.max())],
            "misfit": friction.misfit,
            "share_past_data": friction.past_data,
            "snaps": friction.snaps,
            "models": [model_summary(model) for model in friction.models],
        },
        "remarks": list(made.remarks),
    }


def model_summary(model: ModelFit) -> dict[str, Any]:
    """A law fitted to a test with friction at its ends, for JSON, SI."""
    if model.reason:
        return {"name": model.name, "weight": 0.0, "reason": model.reason}
    return {
        "name": model.name,
        "weight": model.weight,
        "misfit": model.misfit,
        "bic": model.bic,
        "constants": model.constants,
        "sigma": model.sigma,
        "correlation": model.correlation.tolist(),
    }
