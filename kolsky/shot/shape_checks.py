"""What the specimen's outline and the quasi-static curve of a shot must be; anything else is refused."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from kolsky.base.arrays import FloatArray
from kolsky.base.errors import InputError
from kolsky.base.records import CentreLine
from kolsky.shot.schema.curve import CurveSection
from kolsky.shot.schema.reading import ShotToml

RADIUS_TOLERANCE = 0.2
"""Largest disagreement of the outline at rest with the specimen's radius, relative to it."""
LARGEST_STRAIN = 20.0
"""Nominal strain beyond which a column is no strain of an elastomer."""
SMALLEST_CURVE = 5
"""Points away from rest that a curve needs."""


def outline(line: CentreLine, path: Path, rest: float, span: tuple[float, float], toml: ShotToml) -> None:
    """Points before the axis, between the platens, at the specimen's radius while it rests.

    Parameters
    ----------
    line
        The outline in the shot's coordinates, rows as in the file.
    path
        The file it came from.
    rest
        Time of the last static frame on the shot's clock [s].
    span
        The window [s].
    toml
        The shot file.

    Raises
    ------
    InputError
        For the first point that cannot be one of this specimen's outline, or if no point is in the window.
    """
    length, radius = toml.declared.specimen.length, 0.5 * toml.declared.specimen.diameter
    low, high = -0.1 * length, 1.1 * length
    cure = "check columns, units and offsets of [centre_line] in the shot file: are y and Z swapped?"
    for name, value, bad, allowed in (
        ("Z from the axis", line.Z, line.Z <= 0.0, "> 0 mm"),
        (
            "y above the transmission platen",
            line.y,
            (line.y < low) | (line.y > high),
            f"in [{low * 1e3:.6g}, {high * 1e3:.6g}] mm, 10 % around the specimen",
        ),
    ):
        rows = np.flatnonzero(bad)
        if rows.size:
            row = int(rows[0])
            message = f"{name} is {value[row] * 1e3:.6g} mm in frame {line.frame[row]}"
            if rows.size > 1:
                message += f" ({rows.size} such points)"
            raise InputError(path, f"{message}; it must be {allowed}", line=row + 2, cure=cure)
    static = line.time <= rest
    if static.any():
        middle = float(np.median(line.Z[static]))
        if abs(middle - radius) > RADIUS_TOLERANCE * radius:
            raise InputError(
                path,
                f"Z from the axis is {middle * 1e3:.4g} mm (median of the static frames); it must agree with"
                f" the specimen's radius of {radius * 1e3:.4g} mm within {100 * RADIUS_TOLERANCE:g} %",
                cure=cure,
            )
    if not np.any((line.time >= span[0]) & (line.time <= span[1])):
        raise InputError(path, "no point is inside the window", cure="export the frames of the test")


def curve(strain: FloatArray, stress: FloatArray, path: Path, section: CurveSection) -> None:
    """One branch, one sign, from rest outward.

    Parameters
    ----------
    strain
        Nominal strain, tension-positive by the declared convention, rows as in the file [-], shape [n].
    stress
        Nominal stress, likewise [Pa], shape [n].
    path
        The file it came from.
    section
        What the shot file says of it.

    Raises
    ------
    InputError
        For the first row that cannot belong to such a curve.
    """
    branch = 1.0 if section.branch == "tension" else -1.0
    other = "tension" if section.branch == "compression" else "compression"
    _rows(
        path,
        np.abs(strain) > LARGEST_STRAIN,
        strain,
        f"the strain {{value:.6g}} is no strain of an elastomer; it must be in (-1, {LARGEST_STRAIN:g}]",
        "check curve.strain in the shot file: is it the right column and unit?",
    )
    _rows(
        path,
        branch * strain < 0.0,
        strain,
        f"the strain is in {other} ({{value:+.6g}} counted tension-positive), but curve.branch is"
        f' "{section.branch}" and curve.convention "{section.convention}"',
        "correct curve.convention or curve.branch in the shot file; one curve holds one branch",
    )
    _rows(
        path,
        strain <= -1.0,
        strain,
        "the strain {value:.6g} would leave no length; it must be > -1 (tension-positive)",
        "nominal strain is change of length over initial length; check curve.strain and its unit",
    )
    _rows(
        path,
        strain * stress < 0.0,
        stress,
        "the stress {value:+.6g} Pa has the opposite sign of the strain",
        "strain and stress follow one convention; correct the file's signs or remove points near rest",
    )
    _rows(
        path,
        (strain == 0.0) & (stress != 0.0),
        stress,
        "the stress is {value:+.6g} Pa at zero strain",
        "subtract the preload or remove the row",
    )
    forward = np.sign(strain[-1] - strain[0])  # a file may as well begin at the largest strain
    _rows(
        path,
        np.append(False, np.diff(strain) * forward <= 0.0),
        strain,
        "the strain does not move on from the line before: {value:.6g}",
        "keep one loading ramp, smoothed or thinned so that every strain is new",
    )
    if np.count_nonzero(strain) < SMALLEST_CURVE:
        raise InputError(
            path,
            f"has {np.count_nonzero(strain)} points away from rest; it must be at least {SMALLEST_CURVE}",
            cure="export the whole loading ramp",
        )


def _rows(path: Path, bad: NDArray[np.bool_], values: FloatArray, message: str, cure: str) -> None:
    """Refuse the first bad row, saying how many there are."""
    rows = np.flatnonzero(bad)
    if rows.size:
        row = int(rows[0])
        count = f" ({rows.size} such lines)" if rows.size > 1 else ""
        raise InputError(path, message.format(value=values[row]) + count, line=row + 2, cure=cure)
