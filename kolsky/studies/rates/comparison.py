"""Shots compared: mean stiffness, slope over the rate, and quantities at fixed strains.

These are stress, outline and force.

Figs. 13 and 14 of Mates et al. (2012) are shots at fixed strains.
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence

import numpy as np

from explicit.materials import MaterialLaw
from explicit.relaxation import uniaxial_stress
from kolsky.base.arrays import FloatArray
from kolsky.inverse.forward import curve_replicates, material_law
from kolsky.studies.rates.records import (
    MESH_PART,
    WITHHELD,
    EqualStrain,
    GroupRates,
    LongLever,
    QuasiStatic,
    RatedShot,
    RateReport,
    ShapeAtStrain,
    StiffnessAtStrain,
)
from kolsky.studies.rates.scatter import FEWEST_POOLED, TREND_SHARE, Pooled, pool, rate_trend, slope

STEP = 1e-4
"""Half step of the tangent's central difference [-]. Its error is of the order of 1e-8 of the curvature."""
DRAWS = 100
"""Number of curves drawn from the curve's noise. Their standard deviation is accurate to 7 %."""
BASELINE = 61
"""Number of points of the quasi-static line."""
FEWEST_POINTS = 4
"""Smallest number of points of a compared outline."""
Quantities = dict[str, tuple[float, float]]


class Baselines:
    """The laws of quasi-static curves with their replicates. Each is computed once."""

    def __init__(self) -> None:
        self._laws: dict[str, list[MaterialLaw]] = {}

    def reaches(self, baseline: QuasiStatic, strain: float) -> bool:
        """True if the curve was measured up to this compressive strain, as used in Marlow's law."""
        return _measure(strain) <= self._of(baseline)[0].data_limit

    def at(self, baseline: QuasiStatic, strain: float) -> Quantities:
        """The baseline's stress and moduli at a compressive strain, by the law of the solver.

        Returns: nominal stress, secant, tangent and apparent modulus, value and standard uncertainty [Pa]. At
        zero strain, only the tangent modulus. The apparent modulus is Eq. (M.9), 3 stress / (lambda^-2 -
        lambda). The uncertainty is the scatter of curves drawn from the noise of the curve's points. The
        tangent is less certain than the stress.
        """
        drawn = [_quantities(law, strain) for law in self._of(baseline)]
        return {
            name: (value, float(np.std([one[name] for one in drawn[1:]], ddof=1)))
            for name, value in drawn[0].items()
        }

    def stress(self, baseline: QuasiStatic, strain: float) -> float:
        """Nominal compressive stress [Pa]."""
        return _stress(self._of(baseline)[0], strain)

    def _of(self, baseline: QuasiStatic) -> list[MaterialLaw]:
        if baseline.source not in self._laws:
            drawn = curve_replicates(baseline.curve, DRAWS, np.random.default_rng(1))
            self._laws[baseline.source] = [material_law(baseline.curve), *drawn]
        return self._laws[baseline.source]


def _stiffness_at(
    shots: Sequence[RatedShot], strain: float, baselines: Baselines
) -> StiffnessAtStrain | None:
    """Stress and moduli of the shots that reached a strain. None if no shot or no curve reaches it."""
    if not 0.0 <= strain < 1.0:
        raise ValueError(f"a nominal compressive strain must be in [0, 1), got {strain:g}")
    reached = [s for s in shots if s.history.largest >= strain and baselines.reaches(s.quasi_static, strain)]
    if not reached:
        return None
    at = [baselines.at(shot.quasi_static, strain) for shot in reached]
    names = list(at[0])
    m = np.array([shot.m for shot in reached])
    sigma = np.array([shot.sigma for shot in reached])
    values = {name: np.array([one[name][0] for one in at]) for name in names}
    own = {name: np.array([one[name][1] for one in at]) for name in names}
    return StiffnessAtStrain(
        strain=strain,
        shots=tuple(shot.name for shot in reached),
        rates=np.array([shot.history.nominal_rate for shot in reached]),
        quantities={n: (m * values[n], np.hypot(sigma * values[n], m * own[n])) for n in names},
        baseline=at[0],
    )


def _measure(strain: float) -> float:
    """s = sqrt(I1 - 3) of an isochoric uniaxial compression."""
    stretch = 1.0 - strain
    return float(np.sqrt(max(stretch**2 + 2.0 / stretch - 3.0, 0.0)))


def _stress(law: MaterialLaw, strain: float) -> float:
    """Nominal compressive stress of an isochoric uniaxial compression [Pa]."""
    return -float(uniaxial_stress(law, 1.0 - strain))


def _quantities(law: MaterialLaw, strain: float) -> dict[str, float]:
    tangent = (_stress(law, strain + STEP) - _stress(law, strain - STEP)) / (2.0 * STEP)
    if strain == 0.0:
        return {"tangent modulus": tangent}
    stretch, height = 1.0 - strain, _stress(law, strain)
    return {
        "nominal stress": height,
        "secant modulus": height / strain,
        "tangent modulus": tangent,
        "apparent modulus": 3.0 * height / (stretch**-2.0 - stretch),
    }


def equal_strain(
    shots: Sequence[RatedShot], strains: Sequence[float], baselines: Baselines
) -> EqualStrain | None:
    """Force and outline of every shot at the strains that all of them reached.

    None if there are no such strains.

    The force is the mean over a bin, interpolated to the time of the strain. The outline is that of the
    nearest frame, with its strain.

    ``shots``: shots of one group, at least one. ``strains``: nominal compressive strains, each in (0, 1).
    ``baselines``: the laws of their quasi-static curves.
    """
    kept = [e for e in strains if e > 0.0 and all(shot.history.largest >= e for shot in shots)]
    if not shots or not kept:
        return None
    e = np.array(kept)
    rows: dict[str, list[FloatArray]] = {"force_measured": [], "force_sigma": [], "force_model": []}
    for shot in shots:
        c, time = shot.found.comparison, shot.history.time_at(e)
        for name, row in rows.items():
            row.append(np.interp(time, c.force_time, getattr(c, name)))
    shapes = tuple(shape for strain in kept for shot in shots if (shape := _shape(shot, strain)) is not None)
    first = shots[0]
    area = 0.25 * np.pi * first.specimen[0] ** 2
    line = np.linspace(0.0, min(shot.history.largest for shot in shots), BASELINE)
    curve = first.quasi_static
    base = [baselines.stress(curve, x) if baselines.reaches(curve, x) else np.nan for x in line]
    return EqualStrain(
        strains=e,
        shots=tuple(shot.name for shot in shots),
        force=np.stack(rows["force_measured"]),
        sigma=np.stack(rows["force_sigma"]),
        force_model=np.stack(rows["force_model"]),
        baseline_strain=line,
        baseline_force=area * np.array(base),
        shapes=shapes,
    )


def _shape(shot: RatedShot, strain: float) -> ShapeAtStrain | None:
    """The outline in the frame nearest to a strain. None if none was measured or if it has too few points."""
    c, history = shot.found.comparison, shot.history
    line = c.centre_line
    times = np.unique(line.time[line.time <= history.time[-1]])
    if not times.size:
        return None
    time = times[np.argmin(np.abs(times - history.time_at(np.array([strain]))[0]))]
    points = np.flatnonzero(line.time == time)
    if points.size < FEWEST_POINTS:
        return None
    points = points[np.argsort(line.y[points], kind="stable")]
    return ShapeAtStrain(
        shot=shot.name, strain=strain, at=float(np.interp(time, history.time, history.strain)),
        y=line.y[points], Z=line.Z[points], sigma=line.sigma[points],
        model=np.where(c.inside[points], c.Z_model[points], np.nan),
    )  # fmt: skip


STRAINS = (0.1, 0.3, 0.5)
"""Default nominal compressive strains for the comparison of shots."""
SAME_SIZE = 0.02
"""Specimens with a smaller relative size difference are equal in size [-]."""


def compare(
    shots: Sequence[RatedShot],
    *,
    strains: Sequence[float] = STRAINS,
    shared: float = 0.0,
    grouped_by: str = "",
) -> RateReport:
    """Compare shots, at least one, within their groups.

    ``strains``: nominal compressive strains of the tables, each in (0, 1). ``shared``: relative standard
    uncertainty common to all stiffness factors that the results do not include [-]. Examples are a
    transducer's calibration and the baseline's bias. ``grouped_by``: key of the shot files used for grouping.
    Raises ValueError if there is no shot, a strain is outside (0, 1), or `shared` is negative.
    """
    if not shots:
        raise ValueError("there is no shot to compare")
    for strain in strains:
        if not 0.0 < strain < 1.0:
            raise ValueError(f"a nominal compressive strain must be in (0, 1), got {strain:g}")
    if not (np.isfinite(shared) and shared >= 0.0):
        raise ValueError(f"a shared relative uncertainty must be finite and >= 0, got {shared:g}")
    groups: defaultdict[str, list[RatedShot]] = defaultdict(list)
    for shot in sorted(shots, key=lambda s: (s.history.nominal_rate, s.name)):
        groups[shot.group].append(shot)
    wanted, laws = sorted(set(strains)), Baselines()
    made = tuple(_group(name, groups[name], wanted, shared, laws) for name in sorted(groups))
    return RateReport(grouped_by=grouped_by, shared=shared, groups=made)


def _group(
    name: str, shots: list[RatedShot], strains: Sequence[float], shared: float, laws: Baselines
) -> GroupRates:
    counted = [shot for shot in shots if shot.counted]
    common = common_parts(counted, shared)
    pooled = fitted = None
    if len(counted) >= FEWEST_POOLED:
        m = np.array([shot.m for shot in counted])
        own = np.array([shot.sigma_own for shot in counted])
        rows = np.array(list(common.values())).reshape(len(common), len(counted))
        pooled = pool(m, own, common=rows)
        rates = np.array([shot.history.nominal_rate for shot in counted])
        spreads = np.array([shot.history.sigma_decades for shot in counted])
        fitted = slope(rates, spreads, m, own, common=slope_parts(common, rates))
    table = [_stiffness_at(counted, strain, laws) for strain in (0.0, *strains)]
    stiffness = tuple(row for row in table if row is not None)
    return GroupRates(
        name=name,
        shots=tuple(shots),
        common=common,
        pooled=pooled,
        slope=fitted,
        long_lever=None if pooled is None else _long_lever(counted, pooled),
        stiffness=stiffness,
        equal_strain=equal_strain(counted, strains, laws),
        remarks=(*_remarks(shots, counted), *_strains_left_out(counted, stiffness, strains, laws)),
    )


def common_parts(shots: Sequence[RatedShot], shared: float) -> dict[tuple[str, str], FloatArray]:
    """Shared error parts of the shots: (part, common source) -> shift of each m by it, shape [n]. Parts of a
    single shot are included as independent rows. They are thus kept out of the weights, which must not depend
    on errors common to all shots."""
    found: dict[tuple[str, str], FloatArray] = {}
    for i, shot in enumerate(shots):
        for key, value in shot.common_parts().items():
            found.setdefault(key, np.zeros(len(shots)))[i] = value
    if shared > 0.0 and shots:
        found["declared", "all shots"] = shared * np.array([shot.m for shot in shots])
    return found


def slope_parts(common: Mapping[tuple[str, str], FloatArray], rates: FloatArray) -> FloatArray:
    """Effect of shared parts on a slope, [n_shared, n]. Mesh errors are half common, half a trend."""
    rows = []
    for (part, _), row in common.items():
        if part != MESH_PART:
            rows.append(row)
            continue
        rows.append(np.sqrt(1.0 - TREND_SHARE) * row)
        rows.append(np.sqrt(TREND_SHARE) * rate_trend(row, rates))
    return np.array(rows).reshape(len(rows), len(rates))


def _long_lever(shots: Sequence[RatedShot], pooled: Pooled) -> LongLever | None:
    """The line from the quasi-static point, m = 1 by definition, to the mean of the shots, Eq. (S.9)."""
    rates = {shot.quasi_static.rate for shot in shots}
    slow = rates.pop()
    if rates or slow is None:
        return None
    decades = float(np.mean(np.log10([shot.history.nominal_rate for shot in shots])) - np.log10(slow))
    if abs(decades) < 1.0:
        return None
    ends = [(end - 1.0) / decades for end in pooled.interval]
    return LongLever(decades, (pooled.mean - 1.0) / decades, (min(ends), max(ends)))


def _remarks(shots: Sequence[RatedShot], counted: Sequence[RatedShot]) -> list[str]:
    found = [
        f"{shot.name} is not counted: {shot.verdict.value}"
        if not np.isfinite(shot.m) or shot.sigma_own > 0.0
        else f"{shot.name} is not counted: it has no uncertainty, so it would dominate the mean"
        for shot in shots
        if not shot.counted
    ]
    found += [
        f"{shot.name} is included as requested, though it is {shot.verdict.value}"
        for shot in counted
        if shot.verdict in WITHHELD
    ]
    old = [shot.name for shot in counted if not shot.found.fit]
    if old:
        found.append(
            f"whether the model explains the data is not recorded of {', '.join(old)}: an older result; "
            "identify again"
        )
    if len(counted) < FEWEST_POOLED:
        found.append(f"a mean needs {FEWEST_POOLED} shots that count, there are {len(counted)}")
    for what in dict.fromkeys(key for shot in counted for key in shot.conditions):
        found += _differing(what, [(s.name, s.conditions.get(what, "not stated")) for s in counted])
    found += _differing("quasi-static curve", [(s.name, s.quasi_static.source) for s in counted])
    for what, index in (("diameter", 0), ("length", 1)):
        sizes = np.array([shot.specimen[index] for shot in counted])
        if sizes.size and np.ptp(sizes) > SAME_SIZE * sizes.mean():
            found.append(
                f"the specimens' {what}s differ, {1e3 * sizes.min():.4g} to {1e3 * sizes.max():.4g} mm:"
                " forces and shapes at equal strain do not compare"
            )
    return [*found, *_rates_remarks(counted)]


def _differing(what: str, of_shots: Sequence[tuple[str, str]]) -> list[str]:
    """A sentence if a condition differs between the shots."""
    values: defaultdict[str, list[str]] = defaultdict(list)
    for name, value in of_shots:
        values[value].append(name)
    if len(values) < 2:
        return []
    # A file is identified by its hash, shortened to eight digits.
    parts = "; ".join(f"{v[:8] if len(v) == 64 else v} ({', '.join(n)})" for v, n in values.items())
    return [f"the shots were not identified alike, {what}: {parts}; their m may not compare"]


def _rates_remarks(counted: Sequence[RatedShot]) -> list[str]:
    rates = {shot.quasi_static.rate for shot in counted}
    if len(rates) > 1:
        return [
            "the quasi-static curves have different rates, or not all are declared: no line to them is drawn"
        ]
    if rates == {None}:
        return ['no curve has a strain_rate: add strain_rate = "0.03 1/s" to [curve] to draw a line to it']
    return []


def _strains_left_out(
    counted: Sequence[RatedShot],
    stiffness: Sequence[StiffnessAtStrain],
    strains: Sequence[float],
    laws: Baselines,
) -> list[str]:
    """A sentence for every strain that a shot or its curve did not reach."""
    found = []
    there = {row.strain: row.shots for row in stiffness}
    for strain in strains:
        missing = [shot for shot in counted if shot.name not in there.get(strain, ())]
        short = [s.name for s in missing if s.history.largest < strain]
        uncharted = [
            s.name for s in missing if s.name not in short and not laws.reaches(s.quasi_static, strain)
        ]
        if short:
            found.append(f"a strain of {strain:g} was not reached by {', '.join(short)}: left out there")
        if uncharted:
            found.append(
                f"the quasi-static curve of {', '.join(uncharted)} ends before a strain of {strain:g}: no"
                " stress is given there"
            )
    return found
