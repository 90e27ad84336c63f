"""A homogeneous test for a fit: one mode, one curve, tension-positive. Its files and means of repeats."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.base.errors import InputError, refused
from kolsky.material.fits.columns import Columns
from kolsky.material.fits.homogeneous import Mode, check_deformation
from kolsky.readers.measured_tables import WantedColumn, column_names, read_columns, recognised_columns


@dataclass(frozen=True)
class HomogeneousTest:
    """Nominal stress over stretch, or over the amount of shear."""

    name: str
    mode: Mode
    deformation: FloatArray
    """Stretch along the load, or amount of shear [-], shape [n]."""
    stress: FloatArray
    """Nominal stress, tension-positive [Pa], shape [n]."""
    sigma: FloatArray | None = None
    """Standard uncertainty of each stress [Pa], shape [n]; None if unknown."""
    lateral: FloatArray | None = None
    """Measured stretch of the free direction [-], shape [n]; None if not measured."""

    def __post_init__(self) -> None:
        d, T = self.deformation, self.stress
        if d.ndim != 1 or d.shape != T.shape:
            raise ValueError(
                f"{self.name}: deformation {d.shape} and stress {T.shape} must have one shape [n]"
            )
        if len(d) < 3:
            raise ValueError(f"{self.name}: a curve needs at least 3 points, got {len(d)}")
        try:
            check_deformation(self.mode, d)
        except ValueError as error:
            raise ValueError(f"{self.name}: {error}") from None
        if not np.isfinite(T).all():
            raise ValueError(f"{self.name}: stress {int(np.argmin(np.isfinite(T)))} is not finite")
        if not float(self.mode.strain(d) @ T) > 0.0:
            raise ValueError(
                f"{self.name}: stress and strain differ in sign over the whole curve; stress and strain of "
                "compression are both negative here: correct the sign convention"
            )
        if self.sigma is not None and not (self.sigma.shape == T.shape and (self.sigma > 0.0).all()):
            raise ValueError(f"{self.name}: sigma must be > 0 Pa at every point, shape {T.shape}")
        if self.lateral is not None:
            if self.mode is Mode.SIMPLE_SHEAR:
                raise ValueError(f"{self.name}: simple shear has no free direction")
            if not (self.lateral.shape == d.shape and (self.lateral > 0.0).all()):
                raise ValueError(f"{self.name}: lateral stretches must be > 0, shape {d.shape}")

    @property
    def strain(self) -> FloatArray:
        """Nominal strain, or amount of shear [-], shape [n]."""
        return self.mode.strain(self.deformation)


def _outward(test: HomogeneousTest) -> tuple[FloatArray, FloatArray, float]:
    """Size of the strain from rest on, stress, sign of the strain."""
    strain = test.strain
    sign = 1.0 if strain[np.argmax(np.abs(strain))] > 0.0 else -1.0
    size = sign * strain
    if (size < -1e-3 * size.max()).any():
        raise ValueError(f"{test.name} holds tension and compression: repeats are averaged branch by branch")
    if (np.diff(size) <= 0.0).all():  # a table that is sorted by stretch lists compression from its end
        return size[::-1], test.stress[::-1], sign
    back = np.flatnonzero(np.diff(size) < 0.0)
    if back.size:
        raise ValueError(
            f"{test.name}: the strain goes back at point {back[0] + 1} ({strain[back[0]]:.6g} to "
            f"{strain[back[0] + 1]:.6g}): give one loading ramp"
        )
    return size, test.stress, sign


CONVENTIONS = ("tension-positive", "compression-positive")
"""Signs of stress and strain that a file may have."""


TABLE_HEADINGS = ("nominal strain (1)", "nominal stress (Pa)")
"""Headings of strain and stress in the tables of this package: curves, laws without friction."""


def read_homogeneous_test(
    path: str | Path, columns: Columns, *, mode: Mode = Mode.UNIAXIAL
) -> tuple[HomogeneousTest, str]:
    """Read a homogeneous test, positive in tension, and the SHA-256 of its file.

    Raises InputError if the file cannot be read, or if its columns are not a test of this mode.

    Parameters
    ----------
    path
        The file.
    columns
        Columns of stress and deformation, their units and signs.
    mode
        Deformation of the test.
    """
    path, by_force = Path(path), bool(columns.force)
    deformation = columns.displacement if by_force else columns.stretch or columns.strain
    kinds = ("m", "N") if by_force else ("1", "Pa")
    wanted = {
        "deformation": WantedColumn(
            deformation, kinds[0], columns.strain_unit, pure=not by_force, option="--strain-unit"
        ),
        "stress": WantedColumn(
            columns.force or columns.stress, kinds[1], columns.stress_unit, option="--stress-unit"
        ),
    }
    if columns.lateral:
        wanted["lateral"] = WantedColumn(columns.lateral, "1", pure=True, option="in its heading")
    values, sha256 = read_columns(path, wanted, columns.layout)
    sign = 1.0 if columns.convention == "tension-positive" else -1.0
    if columns.loading:
        end = turning_point(values["deformation"])
        values = {what: column[: None if end is None else end + 1] for what, column in values.items()}
    lateral = values.get("lateral")
    if lateral is not None and columns.lateral_strain:
        lateral = lateral + 1.0
    _check_loading(path, values["deformation"])
    if columns.strain and columns.strain_unit is None and not by_force:
        _check_strain_unit(path, columns.strain, values["deformation"])
    if by_force:
        assert columns.length is not None
        assert columns.section is not None
        d = 1.0 + sign * values["deformation"] / columns.length
        stress = sign * values["stress"] / columns.section
    else:
        # A stretch needs no declared sign. Strain and stress have the same sign.
        d = values["deformation"] if columns.stretch else mode.at_rest + sign * values["deformation"]
        stress = sign * values["stress"]
    with refused(path, cure="check columns, units and --convention"):
        test = HomogeneousTest(
            name=path.stem,
            mode=Mode.UNIAXIAL if by_force else mode,
            deformation=d,
            stress=stress,
            lateral=lateral,
        )
    return test, sha256


TURNED_BACK = 0.05
"""Largest decrease of a strain that is scatter of one loading, as a share of its range [-]."""
LARGEST_STRAIN = 5.0
"""Largest strain of a column without a unit that is read as a ratio [-]. Above it, the unit must be
declared."""


def turning_point(strain: FloatArray) -> int | None:
    """Index of the last point before a strain reverses over its previous range; None if it does not.

    A strain is monotonic if it never reverses by more than `TURNED_BACK` of its range. A compression followed
    by a tension in one file jumps back, but has fewer than three points in the previous range.
    """
    allowed = TURNED_BACK * float(np.ptp(strain))
    ways = []
    for way in (strain, -strain):
        behind = np.maximum.accumulate(way) - way
        beyond = np.flatnonzero(behind > allowed)
        if not beyond.size:
            return None
        ways.append(int(np.argmax(way[: beyond[0]])))
    row = max(ways)
    low, high = strain[: row + 1].min() + allowed, strain[: row + 1].max() - allowed
    after = strain[row + 1 :]
    return row if np.count_nonzero((after > low) & (after < high)) >= 3 else None


def _check_loading(path: Path, strain: FloatArray) -> None:
    row = turning_point(strain)
    if row is not None:
        raise InputError(
            path,
            f"is not a single loading: the strain turns back behind point {row + 1}, at {strain[row]:.6g}",
            cure="--loading takes the points up to there; or give a file of the loading alone, in order",
        )


def _check_strain_unit(path: Path, column: str, strain: FloatArray) -> None:
    largest = float(np.abs(strain).max())
    if largest > LARGEST_STRAIN:
        raise InputError(
            path,
            f"column '{column}' has strains up to {largest:.6g} without a unit, as plain ratios a stretch of"
            f" {1.0 + largest:.6g}",
            cure='give its unit: --strain-unit "%", or --strain-unit 1',
        )


def with_recognised_columns(path: Path, columns: Columns) -> tuple[Columns, str]:
    """The columns, recognised by their names if not declared, and a sentence that lists them.

    If a file has all four quantities, strain and stress are used. Force and displacement are used if length
    and section of the specimen are declared. Raises InputError if the file cannot be read.
    """
    if columns.stretch or columns.strain or columns.stress or columns.force or columns.displacement:
        return columns, ""
    layout = columns.layout
    names = {text.rpartition(" (")[0].strip("'") for text in column_names(path, layout)}
    if names.issuperset(TABLE_HEADINGS):
        return replace(columns, strain=TABLE_HEADINGS[0], stress=TABLE_HEADINGS[1]), ""
    recognised = recognised_columns(path, layout)
    pairs = [("strain", "stress"), ("stretch", "stress"), ("displacement", "force")]
    if columns.length is not None and columns.section is not None:
        pairs.reverse()
    for pair in pairs:
        if recognised.keys() >= set(pair):
            words = " and ".join(f"'{recognised[name]}' as the {name}" for name in pair)
            remark = f"{path}: took {words}; name others with --{pair[0]} and --{pair[1]}"
            taken: dict[str, Any] = {name: recognised[name] for name in pair}
            return replace(columns, **taken), remark
    return columns, ""


def with_unique_names(tests: Sequence[HomogeneousTest]) -> tuple[HomogeneousTest, ...]:
    """The tests with unique names. Files with equal names are distinguished by mode and number."""
    made: list[HomogeneousTest] = []
    for test in tests:
        name = test.name
        if sum(other.name == name for other in tests) > 1:
            name = f"{test.mode.value} {name}"
            twins = [t for t in tests if t.name == test.name and t.mode is test.mode]
            if len(twins) > 1:
                name += f" ({1 + sum(t.name.startswith(name) for t in made)})"
        made.append(replace(test, name=name))
    return tuple(made)


def means_by_mode(tests: Sequence[HomogeneousTest], points: int) -> list[HomogeneousTest]:
    """Mean tests of the repeats of each mode, with tension and compression separate.

    ``points``: strains at which they are averaged. Raises ValueError if repeats have too few strains in
    common.
    """
    groups: dict[tuple[Mode, float], list[tuple[str, FloatArray, FloatArray]]] = {}
    for test in tests:
        size, stress, sign = _outward(test)
        groups.setdefault((test.mode, sign), []).append((test.name, size, stress))
    made = []
    for (mode, sign), group in groups.items():
        n = len(group)
        axis = np.linspace(max(e[0] for _, e, _ in group), min(e[-1] for _, e, _ in group), points)
        values = np.array([np.interp(axis, strain, stress) for _, strain, stress in group])
        sigma = values.std(axis=0, ddof=1) / np.sqrt(n) if n > 1 else None
        made.append(
            HomogeneousTest(
                name=group[0][0] if n == 1 else f"mean of {n} {mode.value}",
                mode=mode,
                deformation=mode.at_rest + sign * axis,
                stress=values.mean(axis=0),
                sigma=sigma if sigma is not None and (sigma > 0.0).all() else None,
            )
        )
    return made
