"""The quasi-static curves of a shot, with their bands: of the first pull and of the conditioned material."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal, TypeVar

import numpy as np

from kolsky.base.records import MaterialCurve
from kolsky.readers import uniaxial_csv
from kolsky.readers.table import Column
from kolsky.shot import shape_checks
from kolsky.shot.schema.curve import CurveSection
from kolsky.shot.schema.law import LawSection

if TYPE_CHECKING:
    from kolsky.shot.records import ShotBase

AnyShot = TypeVar("AnyShot", bound="ShotBase")


def read_curve(folder: Path, section: CurveSection | LawSection) -> tuple[MaterialCurve, dict[str, str]]:
    """The quasi-static curve from rest outward, with the conditioned one if it is declared; or a law's own.

    Returns
    -------
    tuple
        The curve, and the hash of every file that was read.

    Raises
    ------
    InputError
        If a file cannot be read or holds no such curve.
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

    Raises
    ------
    ValueError
        If the conditioned curve is asked for and the shot has none.
    """
    if pull == "first":
        return shot
    if shot.curve.conditioned is None:
        raise ValueError("the shot has no conditioned curve: name its file in curve.conditioned of shot.toml")
    return replace(shot, curve=shot.curve.conditioned)


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
    table = uniaxial_csv.read(
        path,
        strain=section.strain.as_column(),
        stress=section.stress.as_column(),
        sigma=None if section.sigma is None else section.sigma.as_column(),
        modes=None if section.modes is None else Column(section.modes.prefix, section.modes.unit),
    )
    sign = 1.0 if section.convention == "tension positive" else -1.0
    strain, stress = sign * table.strain, sign * table.stress
    shape_checks.curve(strain, stress, table.path, section)
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
