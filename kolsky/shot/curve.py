"""The quasi-static curves of a shot, with their bands: of the first pull and of the conditioned material."""

from dataclasses import replace
from pathlib import Path
from typing import Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from kolsky.base.arrays import FloatArray
from kolsky.base.errors import InputError
from kolsky.base.records import MaterialCurve
from kolsky.readers.measured_tables import UniaxialTable, read_uniaxial
from kolsky.readers.table import Column
from kolsky.schema.material import CurveSection, LawSection
from kolsky.shot.records import Shot, ShotBase

AnyShot = TypeVar("AnyShot", bound=ShotBase)

LARGEST_STRAIN = 20.0
"""Nominal strain beyond which a column is no strain of an elastomer."""
SMALLEST_CURVE = 5
"""Points away from rest that a curve needs."""
PAST_CURVE = 0.01
"""Share of the specimen past the curve from which on it is said [-]."""


def read_curve(folder: Path, section: CurveSection | LawSection) -> tuple[MaterialCurve, dict[str, str]]:
    """The quasi-static curve from rest outward, with the conditioned one if it is declared; or a law's own.

    Returns: the curve, and the hash of every file that was read. Raises InputError if a file cannot be read
    or holds no such curve.
    """
    if isinstance(section, LawSection):
        return section.curve(), {}
    curve, digest = _read(folder / section.file, section)
    hashes = {section.file: digest}
    if section.conditioned is not None:
        other, digest = _read(folder / section.conditioned, section)
        hashes[section.conditioned] = digest
        curve = replace(curve, conditioned=other)
    return curve, hashes


def with_pull(shot: AnyShot, pull: Literal["first", "conditioned"]) -> AnyShot:
    """The shot with the curve that its stiffness factor is to refer to.

    Raises ValueError if the conditioned curve is asked for and the shot has none.
    """
    if pull == "first":
        return shot
    if shot.curve.conditioned is None:
        raise ValueError("the shot has no conditioned curve: name its file in curve.conditioned of shot.toml")
    found = replace(shot, curve=shot.curve.conditioned)
    if isinstance(shot, Shot):
        vars(found)["flyer_path"] = shot.flyer_path  # of the same motion: fitted once
    return found


def conditioned_ratio(curve: MaterialCurve) -> float | None:
    """Mean stress of the conditioned over the first pull's curve where both have data [-], or None."""
    other = curve.conditioned
    if other is None:
        return None
    strain, beside = np.abs(curve.stretch - 1.0), np.abs(other.stretch - 1.0)
    inside = (strain > 0.0) & (strain >= beside[beside > 0.0].min()) & (strain <= beside.max())
    if not inside.any():
        return None
    return float(np.mean(np.interp(strain[inside], beside, other.stress) / curve.stress[inside]))


def _read(path: Path, section: CurveSection) -> tuple[MaterialCurve, str]:
    table = read_uniaxial(
        path,
        strain=section.strain.as_column(),
        stress=section.stress.as_column(),
        sigma=None if section.sigma is None else section.sigma.as_column(),
        modes=None if section.modes is None else Column(section.modes.prefix, section.modes.unit),
        layout=None if section.layout is None else section.layout.as_layout(),
    )
    sign = 1.0 if section.convention == "tension positive" else -1.0
    strain, stress = sign * table.strain, sign * table.stress
    check_curve(strain, stress, table, section)
    order = np.argsort(np.abs(strain))
    sigma = np.hypot(section.relative_sigma * stress, section.sigma_floor)
    if table.sigma is not None:
        sigma = np.hypot(sigma, table.sigma)
    curve = MaterialCurve(
        stretch=1.0 + strain[order],
        stress=stress[order],
        sigma=sigma[order],
        modes=None if table.modes is None else sign * table.modes[:, order],
    )
    return curve, table.sha256


def check_curve(strain: FloatArray, stress: FloatArray, table: UniaxialTable, section: CurveSection) -> None:
    """One branch, one sign, from rest outward."""
    branch = 1.0 if section.branch == "tension" else -1.0
    other = "tension" if section.branch == "compression" else "compression"
    _rows(
        table,
        np.abs(strain) > LARGEST_STRAIN,
        strain,
        f"the strain {{value:.6g}} is no strain of an elastomer; it must be in (-1, {LARGEST_STRAIN:g}]",
        "check curve.strain in the shot file: is it the right column and unit?",
    )
    _rows(
        table,
        branch * strain < 0.0,
        strain,
        f"the strain is in {other} ({{value:+.6g}} counted tension-positive), but curve.branch is"
        f' "{section.branch}" and curve.convention "{section.convention}"',
        "correct curve.convention or curve.branch in the shot file; one curve holds one branch",
    )
    _rows(
        table,
        strain <= -1.0,
        strain,
        "the strain {value:.6g} would leave no length; it must be > -1 (tension-positive)",
        "nominal strain is change of length over initial length; check curve.strain and its unit",
    )
    _rows(
        table,
        strain * stress < 0.0,
        stress,
        "the stress {value:+.6g} Pa has the opposite sign of the strain",
        "strain and stress follow one convention; correct the file's signs or remove points near rest",
    )
    _rows(
        table,
        (strain == 0.0) & (stress != 0.0),
        stress,
        "the stress is {value:+.6g} Pa at zero strain",
        "subtract the preload or remove the row",
    )
    forward = np.sign(strain[-1] - strain[0])  # a file may as well begin at the largest strain
    _rows(
        table,
        np.append(False, np.diff(strain) * forward <= 0.0),
        strain,
        "the strain does not move on from the line before: {value:.6g}",
        "keep one loading ramp, smoothed or thinned so that every strain is new",
    )
    if np.count_nonzero(strain) < SMALLEST_CURVE:
        raise InputError(
            table.path,
            f"has {np.count_nonzero(strain)} points away from rest; it must be at least {SMALLEST_CURVE}",
            cure="export the whole loading ramp",
        )


def _rows(table: UniaxialTable, bad: NDArray[np.bool_], values: FloatArray, message: str, cure: str) -> None:
    """Refuse the first bad row, saying how many there are."""
    rows = np.flatnonzero(bad)
    if rows.size:
        row = int(rows[0])
        count = f" ({rows.size} such lines)" if rows.size > 1 else ""
        raise InputError(
            table.path, message.format(value=values[row]) + count, line=table.line(row), cure=cure
        )
