"""The declared specimen of a shot, and its quasi-static curves (first pull, conditioned) with their bands."""

from dataclasses import replace
from pathlib import Path
from typing import Any, Literal, TypeVar

import numpy as np

from kolsky.base.apparatus import Specimen
from kolsky.base.arrays import FloatArray
from kolsky.base.errors import InputError
from kolsky.base.records import MaterialCurve
from kolsky.base.toml import TomlFile
from kolsky.readers.table import Column, Table, read_table
from kolsky.schema.fields import ModeColumns
from kolsky.schema.material import CurveSection, LawSection, declared_relaxation
from kolsky.schema.shot_file import CommonTables
from kolsky.shot.records import ModelSettings, Shot, ShotBase

AnyShot = TypeVar("AnyShot", bound=ShotBase)

LARGEST_STRAIN = 20.0
"""Largest nominal strain of an elastomer [-]; a column with larger values is rejected."""
MOST_MODES = 1000
"""Maximum number of columns of common (correlated) uncertainties."""
SMALLEST_CURVE = 5
"""Smallest number of curve points with nonzero strain."""
PAST_CURVE = 0.01
"""A warning is given if a larger share of the specimen than this is strained beyond the curve [-]."""


def read_curve(folder: Path, section: CurveSection | LawSection) -> tuple[MaterialCurve, dict[str, str]]:
    """The quasi-static curve and, if declared, the conditioned curve; or the curve of a declared law.

    Returns: the curve, from rest outward, and the hash of every file that was read. Raises InputError if a
    file cannot be read or has no such curve.
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


def shot_fields(file: TomlFile, declared: CommonTables) -> dict[str, Any]:
    """The fields of `ShotBase` that do not depend on the measurement method.

    Raises InputError as `read_curve`.
    """
    folder = file.path.parent
    curve, hashes = read_curve(folder, declared.baseline)
    return {
        "name": declared.name or folder.resolve().name,
        "folder": folder,
        "file": file,
        "specimen": Specimen(**declared.specimen.model_dump()),
        "interface": declared.interface.interface(),
        "model": ModelSettings(**declared.model.model_dump()),
        "curve": curve,
        "inputs": hashes,
        **declared_relaxation(declared.relaxation, declared.uncertainty),
    }


def with_pull(shot: AnyShot, pull: Literal["first", "conditioned"]) -> AnyShot:
    """The shot with the curve to which its stiffness factor refers.

    Raises ValueError if the conditioned curve is requested and the shot has none.
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
    """Mean stress ratio of the conditioned curve to the first pull over common strains [-], or None."""
    other = curve.conditioned
    if other is None:
        return None
    strain, beside = np.abs(curve.stretch - 1.0), np.abs(other.stretch - 1.0)
    inside = (strain > 0.0) & (strain >= beside[beside > 0.0].min()) & (strain <= beside.max())
    if not inside.any():
        return None
    return float(np.mean(np.interp(strain[inside], beside, other.stress) / curve.stress[inside]))


def _read(path: Path, section: CurveSection) -> tuple[MaterialCurve, str]:
    layout = None if section.layout is None else section.layout.as_layout()
    table = read_table(path, layout=layout)
    sign = 1.0 if section.convention == "tension positive" else -1.0
    strain = sign * table.values(section.strain.as_column())
    stress = sign * table.values(section.stress.as_column())
    sigma = np.hypot(section.relative_sigma * stress, section.sigma_floor)
    if section.sigma is not None:
        sigma = np.hypot(sigma, table.values(replace(section.sigma.as_column(), bound=">= 0")))
    modes = None if section.modes is None else sign * _modes(table, section.modes)
    check_curve(strain, stress, table, section)
    order = np.argsort(np.abs(strain))
    curve = MaterialCurve(
        stretch=1.0 + strain[order],
        stress=stress[order],
        sigma=sigma[order],
        modes=None if modes is None else modes[:, order],
    )
    return curve, table.sha256


def _modes(table: Table, section: ModeColumns) -> FloatArray:
    """All columns of common uncertainties (names with one prefix), shape [n_modes, n]."""
    names = [name for name in table.names if name.startswith(section.prefix)]
    if not 1 <= len(names) <= MOST_MODES:
        message = f"{len(names)} columns begin with '{section.prefix}', 1 to {MOST_MODES} are read"
        cure = "correct the beginning in the shot file, or leave it out"
        raise InputError(table.path, message, line=table.header_line, cure=cure)
    return np.array([table.values(Column(name, section.unit)) for name in names])


def check_curve(strain: FloatArray, stress: FloatArray, table: Table, section: CurveSection) -> None:
    """Check that the curve has one branch and one sign, and runs from rest outward."""
    branch = 1.0 if section.branch == "tension" else -1.0
    other = "tension" if section.branch == "compression" else "compression"
    largest, doubt = float(np.abs(strain).max()), "is"
    if section.strain.unit == 1.0 and largest <= 100.0 * LARGEST_STRAIN:
        doubt = 'are they per cent? Then write curve.strain.unit = "%": '
        doubt += f"the largest is {0.01 * largest:.4g}; or is"
    forward = np.sign(strain[-1] - strain[0])  # a file may as well begin at the largest strain
    for bad, values, message, cure in (
        (
            np.abs(strain) > LARGEST_STRAIN,
            strain,
            "the strain {value:.6g} is not a strain of an elastomer; it must be in "
            f"(-1, {LARGEST_STRAIN:g}]",
            doubt + " curve.strain the right column?",
        ),
        (
            branch * strain < 0.0,
            strain,
            f"the strain is in {other} ({{value:+.6g}} counted tension-positive), but curve.branch is"
            f' "{section.branch}" and curve.convention "{section.convention}"',
            "correct curve.convention or curve.branch in the shot file; one curve holds one branch",
        ),
        (
            strain <= -1.0,
            strain,
            "the strain {value:.6g} would leave no length; it must be > -1 (tension-positive)",
            "nominal strain is change of length over initial length; check curve.strain and its unit; of a "
            "column of logarithmic (true) strain e declare exp(e) - 1",
        ),
        (
            strain * stress < 0.0,
            stress,
            "the stress {value:+.6g} Pa has the opposite sign of the strain",
            "strain and stress follow one convention; correct the file's signs or remove points near rest",
        ),
        (
            (strain == 0.0) & (stress != 0.0),
            stress,
            "the stress is {value:+.6g} Pa at zero strain",
            "subtract the preload or remove the row",
        ),
        (
            np.append(False, np.diff(strain) * forward <= 0.0),
            strain,
            "the strain does not move on from the line before: {value:.6g}",
            "keep one loading ramp, smoothed or thinned so that every strain is new",
        ),
    ):
        rows = np.flatnonzero(bad)
        if rows.size:
            count = f" ({rows.size} such lines)" if rows.size > 1 else ""
            line = table.first_line + int(rows[0])
            raise InputError(table.path, message.format(value=values[rows[0]]) + count, line=line, cure=cure)
    if np.count_nonzero(strain) < SMALLEST_CURVE:
        raise InputError(
            table.path,
            f"has {np.count_nonzero(strain)} points away from rest; it must be at least {SMALLEST_CURVE}",
            cure="export the whole loading ramp",
        )
