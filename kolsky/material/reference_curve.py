"""Reference curve for a dynamic test, from repeated quasi-static tests and their files."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import isfinite, sqrt
from pathlib import Path
from typing import Any, Literal

import numpy as np

from dic.basics import check_interval
from dic.views import ResultViews
from kolsky.base.apparatus import Specimen
from kolsky.base.arrays import FloatArray
from kolsky.base.errors import refused
from kolsky.material.end_friction.correct import correct_friction
from kolsky.material.end_friction.problem import CorrectionNumerics, EndFriction, FrictionCorrection, ModelFit
from kolsky.material.uniaxial import (
    ApparentModulus,
    CurveBand,
    Hold,
    Toe,
    UniaxialTest,
    ZeroedTest,
    apparent_modulus,
    correct_toe,
    divide_ramp_and_hold,
    loading_ramps,
    mean_of_repeats,
    remarks_of,
    resample,
    student_factor,
)
from kolsky.readers.layout import Layout
from kolsky.readers.measured_tables import WantedColumn, read_columns

Pull = Literal["first", "conditioned"]

PAST_DATA = 0.25
"""A share of the specimen that is strained beyond the curve's end is reported if it exceeds this."""
FEWEST_POINTS = 8
"""Smallest number of points of a curve. A law needs 5 points away from rest."""


@dataclass(frozen=True)
class Treatment:
    """Declared treatment of the tests. No part of it is derived from the data.

    Raises ValueError if a value is outside its range, or if the specimen's size is missing.
    """

    toe: Toe = field(default_factory=Toe)
    compliance: float = 0.0
    """Compliance of the machine [m/N]; needs `specimen`."""
    scale_sigma: float = 0.0
    """Relative standard uncertainty that all tests have in common, of load cell and cross-section [-]."""
    specimen: Specimen | None = None
    """Undeformed size, for the compliance and for the friction."""
    ends: EndFriction | None = None
    """Contact at the specimen's ends; None: frictionless."""
    bulge_sigma: float = 0.0
    """Standard deviation of the radius at mid-height [m]."""
    points: int = 60
    last: float | None = None
    """Strain at which the curve ends [-]. None: the curve ends at the end of the shortest test."""
    numerics: CorrectionNumerics | None = None

    def __post_init__(self) -> None:
        check_interval("[0, inf)", compliance=self.compliance, bulge_sigma=self.bulge_sigma)
        if self.points < FEWEST_POINTS:
            raise ValueError(f"a curve needs at least {FEWEST_POINTS} points, got {self.points}")
        if not 0.0 <= self.scale_sigma < 0.5:
            raise ValueError(f"the scale's relative sigma must be in [0, 0.5), got {self.scale_sigma}")
        if self.specimen is None and (self.compliance > 0.0 or self.ends is not None):
            raise ValueError("compliance and end friction need the specimen's diameter and length")


@dataclass(frozen=True)
class ReferenceCurve(ResultViews):
    """The curve of the material, with the intermediate results."""

    pull: Pull
    """Loading ramps: the first pull, or the last one of conditioned specimens."""
    compression: bool
    """True if the branch is compression."""
    tests: tuple[ZeroedTest, ...]
    """Every test's ramp after compliance and toe."""
    apparent: CurveBand
    """Mean of the tests, as for ends that slide freely."""
    band: CurveBand
    """The material's curve: `apparent`, or the curve without friction if friction is declared."""
    modulus: ApparentModulus
    """E_a of the material's curve, Eq. (M.9)."""
    friction: FrictionCorrection | None
    remarks: tuple[str, ...]


def reference_curve(
    tests: Sequence[UniaxialTest], treatment: Treatment, *, pull: Pull = "first"
) -> ReferenceCurve:
    """Average repeats and remove effects of machine and friction.

    The order is: compliance, choice of the ramp, toe, mean with its band, end friction.

    Raises ValueError if the pull is unknown, if the tests differ in branch, if a record has no such ramp, or
    if a toe cannot be found. The same error is raised if the tests have no range of strain in common, if
    friction is declared for a tension test, or if friction cannot be removed.

    Parameters
    ----------
    tests
        Repeats of one test on specimens of one size and one branch.
    treatment
        Declared treatment of the tests.
    pull
        "first": the first loading ramp of each record. "conditioned": the last of two or more ramps, with
        strains relative to the length before the first pull. A permanent set is part of its toe's offset.
    """
    if pull not in ("first", "conditioned"):
        raise ValueError(f"pull must be 'first' or 'conditioned', got {pull!r}")
    if not tests:
        raise ValueError("a reference curve needs at least one test")
    compression = tests[0].compression
    if any(test.compression is not compression for test in tests):
        raise ValueError("a reference curve has one branch; these tests are of tension and of compression")
    if treatment.ends is not None and not compression:
        raise ValueError("end friction can be corrected in compression tests only")
    ramps = [_ramp(test, treatment, pull) for test in tests]
    begun = tuple(correct_toe(ramp, treatment.toe) for ramp, _ in ramps)
    axis = _axis([one.test for one in begun], treatment)
    apparent, remarks = _mean(begun, axis, treatment)
    remarks += tuple(
        said for test, (_, hold) in zip(tests, ramps, strict=True) for said in remarks_of(test.name, hold)
    )
    times, bulge = _mean_time_and_bulge(begun, axis)
    friction, band = None, apparent
    if treatment.ends is not None:
        assert treatment.specimen is not None
        friction = correct_friction(
            apparent,
            treatment.specimen,
            treatment.ends,
            bulge=bulge,
            bulge_sigma=treatment.bulge_sigma / sqrt(len(tests)),
            numerics=treatment.numerics,
        )
        band = friction.band
        remarks += friction.remarks
        if friction.past_data > PAST_DATA:
            remarks += (
                f"at the largest strain {100.0 * friction.past_data:.0f} % of the barrelled specimen was"
                " strained past the end of the curve: there the correction extrapolates the laws, and their"
                " spread is in the band",
            )
    return ReferenceCurve(
        pull=pull,
        compression=compression,
        tests=begun,
        apparent=apparent,
        band=band,
        modulus=apparent_modulus(band, compression=compression, time=times),
        friction=friction,
        remarks=remarks,
    )


def softening(first: ReferenceCurve, conditioned: ReferenceCurve) -> tuple[float, float]:
    """Ratio of the stress of the conditioned pull to that of the first pull, for each specimen.

    Returns the mean over the strains of both curves and over the specimens [-], and its standard uncertainty.
    The latter is widened for the degrees of freedom; with one specimen it is NaN. Raises ValueError if the
    curves have no strain in common.
    """
    axis, other = first.apparent.strain, conditioned.apparent.strain
    axis = axis[(axis >= other[0]) & (axis <= other[-1])]
    if axis.size < 2:
        raise ValueError("the first and the conditioned pull have no range of strain in common")
    before, after = (
        np.stack([resample(one.test.strain, one.test.stress, axis)[0] for one in made.tests])
        for made in (first, conditioned)
    )
    ratio = (after / before).mean(axis=1)
    if ratio.size < 2:
        return float(ratio[0]), float("nan")
    sigma = student_factor(ratio.size - 1) * ratio.std(ddof=1) / sqrt(ratio.size)
    return float(ratio.mean()), float(sigma)


def _ramp(test: UniaxialTest, treatment: Treatment, pull: Pull) -> tuple[UniaxialTest, Hold | None]:
    """The selected ramp, up to its final strain, and the hold after it."""
    if treatment.compliance > 0.0:
        size = treatment.specimen
        assert size is not None
        test = test.without_machine(treatment.compliance, area=size.area, length=size.length)
    ramps = loading_ramps(test)
    if pull == "conditioned" and len(ramps) < 2:
        raise ValueError(
            f"{test.name}: the record has one loading ramp; a conditioned specimen was loaded before"
        )
    ramp, hold = divide_ramp_and_hold(test, ramps[0] if pull == "first" else ramps[-1])
    return test.part(ramp), hold


def _axis(tests: Sequence[UniaxialTest], treatment: Treatment) -> FloatArray:
    """Equal steps from rest to the end that all tests reach, without their toes."""
    low, high = max(t.strain.min() for t in tests), min(t.strain.max() for t in tests)
    if treatment.last is not None:
        if not 0.0 < treatment.last <= high:
            raise ValueError(f"the curve may end at a strain in (0, {high:.4g}], got {treatment.last:.4g}")
        high = treatment.last
    axis = np.linspace(0.0, high, treatment.points + 1)[1:]
    kept = axis[axis >= low - 1e-12]
    if kept.size < FEWEST_POINTS:
        first = max(tests, key=lambda t: float(t.strain.min())).name
        last = min(tests, key=lambda t: float(t.strain.max())).name
        raise ValueError(
            f"the tests have too little strain in common: {first} begins at {low:.4g}, {last} ends at"
            f" {high:.4g}; {kept.size} of {treatment.points} points are left, {FEWEST_POINTS} are needed"
        )
    return kept


def _mean(
    begun: Sequence[ZeroedTest], axis: FloatArray, treatment: Treatment
) -> tuple[CurveBand, tuple[str, ...]]:
    found = [resample(one.test.strain, one.test.stress, axis) for one in begun]
    values = np.stack([value for value, _ in found])
    wrong = np.argwhere(values <= 0.0)
    if wrong.size:
        test, place = begun[wrong[0, 0]].test, wrong[0, 1]
        raise ValueError(
            f"{test.name}: the stress is {values[tuple(wrong[0])]:.4g} Pa at strain {axis[place]:.4g}, not"
            " > 0; declare a toe, or correct the sign or the zero of the force"
        )
    remarks: tuple[str, ...] = ()
    if len(begun) > 1:
        band = mean_of_repeats(axis, values)
    else:
        noise = np.full(axis.size, found[0][1])
        band = CurveBand(axis, values[0], noise, np.empty((0, axis.size)), ())
        if begun[0].sigma > 0.0:
            band = band.with_mode("toe", begun[0].sigma * np.gradient(values[0], axis))
        remarks = ("one test: the scatter between specimens is unknown and not in the band",)
    if treatment.scale_sigma > 0.0:
        band = band.with_mode("force and section", treatment.scale_sigma * band.stress)
    return band, remarks


def _mean_time_and_bulge(
    begun: Sequence[ZeroedTest], axis: FloatArray
) -> tuple[FloatArray | None, FloatArray | None]:
    """Mean time since the strain was zero, and mean radius at mid-height, if all tests have them."""
    tests = [one.test for one in begun]
    times, radii = [], []
    for test in tests:
        if test.time is not None:
            when, _ = resample(test.strain, test.time, axis)
            rate = np.polyfit(when, axis, 1)[0]
            times.append(when - (when[0] - axis[0] / rate))
        if test.bulge is not None:
            radii.append(resample(test.strain, test.bulge, axis)[0])
    complete = [np.mean(rows, axis=0) if len(rows) == len(tests) else None for rows in (times, radii)]
    return complete[0], complete[1]


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
    layout: Layout | None = None,
    specimen: Specimen | None = None,
) -> tuple[UniaxialTest, str]:
    """Read a quasi-static test, positive along its branch, and the SHA-256 of its file.

    Raises InputError if the file cannot be read, or if its columns are not such a test.

    Parameters
    ----------
    path
        The file.
    columns
        Kind of `COLUMNS` -> column, by name or number: strain and stress, or displacement and force.
    convention
        Sign of the columns, one of `kolsky.material.fits.homogeneous_test.CONVENTIONS`.
    branch
        One of `BRANCHES`.
    units
        Column -> unit, if the file does not give it.
    layout
        Declared layout of the file. Undeclared properties are detected.
    specimen
        Undeformed size; needed for displacement and force.
    """
    path, units = Path(path), units or {}
    wanted = {kind: WantedColumn(name, COLUMNS[kind], units.get(name)) for kind, name in columns.items()}
    values, digest = read_columns(path, wanted, layout)
    compression = branch == "compression"
    sign = 1.0 if compression == (convention == "compression-positive") else -1.0
    if specimen is not None and "force" in columns:
        values["strain"] = values["displacement"] / specimen.length
        values["stress"] = values["force"] / specimen.area
    with refused(path, cure="are column, unit, branch and convention right?"):
        strain, stress = sign * values["strain"], sign * values["stress"]
        more = {key: values.get(key) for key in ("time", "bulge")}
        return UniaxialTest(path.name, strain, stress, compression=compression, **more), digest


def curve_columns(made: ReferenceCurve | CurveBand) -> dict[str, list[float]]:
    """A table that `[curve]` of a shot.toml reads, strain and stress positive along the branch."""
    band = made if isinstance(made, CurveBand) else made.band
    modes = {
        f"{MODE} {number}: {name} (Pa)": row.tolist()
        for number, (name, row) in enumerate(zip(band.names, band.modes, strict=True), start=1)
    }
    return {
        "nominal strain (1)": band.strain.tolist(),
        "nominal stress (Pa)": band.stress.tolist(),
        "independent sigma (Pa)": band.noise.tolist(),
        **modes,
    }


def modulus_columns(made: ReferenceCurve) -> dict[str, list[float]]:
    """E_a over strain and time with its k = 2 interval, and that of the uncorrected curve."""
    modulus = made.modulus
    low, high = modulus.interval()
    apparent = apparent_modulus(made.apparent, compression=made.compression)
    time = {} if modulus.time is None else {"time since zero strain (s)": modulus.time.tolist()}
    return {
        "nominal strain (1)": modulus.strain.tolist(),
        **time,
        "E_a (Pa)": modulus.modulus.tolist(),
        "low end, k = 2 (Pa)": low.tolist(),
        "high end, k = 2 (Pa)": high.tolist(),
        "E_a as if frictionless (Pa)": apparent.modulus.tolist(),
    }


def curve_table(name: str, band: CurveBand, *, compression: bool, conditioned: str | None = None) -> str:
    """The table `[curve]` for a shot.toml that reads the curve."""
    side = "compression" if compression else "tension"
    known = bool(band.names or band.noise.any())
    lines = [
        "[curve]",
        f'file = "{name}"',
        'strain = { column = "nominal strain (1)", unit = "1" }',
        'stress = { column = "nominal stress (Pa)", unit = "Pa" }',
        f'convention = "{side} positive"',
        f'branch = "{side}"',
        'sigma = { column = "independent sigma (Pa)", unit = "Pa" }'
        if known
        else 'relative_sigma = ""  # fill in: the curve has no uncertainty',
        *([f'modes = {{ prefix = "{MODE} ", unit = "Pa" }}'] if band.names else []),
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
        "sigma": {name: u if isfinite(u) else None for name, u in model.sigma.items()},
        "not_determined": list(model.not_determined),
        "correlation": model.correlation.tolist(),
    } | ({"remark": model.remark} if model.remark else {})
