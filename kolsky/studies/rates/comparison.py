"""From identified shots to a report on their rates: groups, means, slopes, and what must be said of them."""

from collections import defaultdict
from collections.abc import Sequence

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.studies.rates.at_strain import Baselines, equal_strain, stiffness_at
from kolsky.studies.rates.pooled import FEWEST, Pooled, pool
from kolsky.studies.rates.records import (
    WITHHELD,
    GroupRates,
    LongLever,
    RatedShot,
    RateReport,
    StiffnessAtStrain,
)
from kolsky.studies.rates.regression import slope

STRAINS = (0.1, 0.3, 0.5)
"""Nominal compressive strains at which shots are compared unless others are asked for."""
SAME_SIZE = 0.02
"""Specimens whose sizes differ by less are one size [-]."""


def compare(
    shots: Sequence[RatedShot],
    *,
    strains: Sequence[float] = STRAINS,
    shared: float = 0.0,
    grouped_by: str = "",
) -> RateReport:
    """Compare shots within their groups.

    Parameters
    ----------
    shots
        At least one.
    strains
        Nominal compressive strains of the tables, each in (0, 1).
    shared
        Relative standard uncertainty of all stiffness factors together, e.g. of a transducer's calibration or
        the baseline's bias, which no result contains [-].
    grouped_by
        Key of the shot files that gave the groups.

    Raises
    ------
    ValueError
        If there is no shot, a strain is outside (0, 1), or `shared` is negative.
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
    if len(counted) >= FEWEST:
        m = np.array([shot.m for shot in counted])
        own = np.array([shot.sigma_own for shot in counted])
        rows = np.array(list(common.values())).reshape(len(common), len(counted))
        pooled = pool(m, own, common=rows)
        rates = np.array([shot.history.nominal_rate for shot in counted])
        spreads = np.array([shot.history.sigma_decades for shot in counted])
        fitted = slope(rates, spreads, m, own, common=rows)
    table = [stiffness_at(counted, strain, laws) for strain in (0.0, *strains)]
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
        remarks=(
            *_remarks(shots, counted),
            *_strains_left_out(counted, stiffness, strains, laws),
        ),
    )


def common_parts(shots: Sequence[RatedShot], shared: float) -> dict[tuple[str, str], FloatArray]:
    """Shared parts of the shots: (part, through what) -> by how much each m moves with it, shape [n].

    Parts that belong to one shot alone are here as well: they are independent, and counting them so keeps
    them out of the weights, which the errors that all have must not decide.
    """
    found: dict[tuple[str, str], FloatArray] = {}
    for i, shot in enumerate(shots):
        for key, value in shot.common_parts().items():
            found.setdefault(key, np.zeros(len(shots)))[i] = value
    if shared > 0.0 and shots:
        found["declared", "all shots"] = shared * np.array([shot.m for shot in shots])
    return found


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
        else f"{shot.name} is not counted: it has no uncertainty of its own, so that it would decide alone"
        for shot in shots
        if not shot.counted
    ]
    found += [
        f"{shot.name} is counted as asked for, though it is {shot.verdict.value}"
        for shot in counted
        if shot.verdict in WITHHELD
    ]
    old = [shot.name for shot in counted if not shot.found.fit]
    if old:
        found.append(
            f"whether the model explains the data is not recorded of {', '.join(old)}: an older result; "
            "identify again"
        )
    if len(counted) < FEWEST:
        found.append(f"a mean needs {FEWEST} shots that count, there are {len(counted)}")
    for what in dict.fromkeys(key for shot in counted for key in shot.conditions):
        found += _differing(what, [(s.name, s.conditions.get(what, "not said")) for s in counted])
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
    """A sentence if a condition is not the same for all shots."""
    values: defaultdict[str, list[str]] = defaultdict(list)
    for name, value in of_shots:
        values[value].append(name)
    if len(values) < 2:
        return []
    # A file is known by its hash; eight digits tell it from others.
    parts = "; ".join(f"{v[:8] if len(v) == 64 else v} ({', '.join(n)})" for v, n in values.items())
    return [f"the shots were not identified alike, {what}: {parts}; their m may not compare"]


def _rates_remarks(counted: Sequence[RatedShot]) -> list[str]:
    rates = {shot.quasi_static.rate for shot in counted}
    if rates and rates != {None} and len(rates) > 1:
        return ["the quasi-static curves have different rates, or not all are declared: no line to them"]
    if rates == {None}:
        return ['no curve says its strain_rate: add strain_rate = "0.03 1/s" to [curve] for a line to it']
    return []


def _strains_left_out(
    counted: Sequence[RatedShot],
    stiffness: Sequence[StiffnessAtStrain],
    strains: Sequence[float],
    laws: Baselines,
) -> list[str]:
    """A sentence for every strain that a shot, or its curve, did not reach."""
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
