"""Plausibility checks of a shot's inputs, before any computation.

Inputs are compared with each other and with usual values. A rule is one function and one line of `RULES`;
rules for single declared values are in `kolsky.shot.declared_values`. A rule compares the known inputs and
yields findings. A warning names both keys and both values. For a contradiction, the shot is rejected, with
the unit or factor that would correct it. `gate` is called as soon as a record is read. It therefore reports
the cause before a later check finds its effect.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.base.errors import refuse
from kolsky.base.records import FlyerMotion, MaterialCurve
from kolsky.shot.declared_values import (
    SPECIMEN_SIZES,
    check_bar_speeds,
    check_channels,
    check_densities,
    check_specimen_size,
    check_unit_of_heading,
)
from kolsky.shot.evidence import (
    LENGTH_FACTORS,
    Evidence,
    Finding,
    fitting_factor,
    fitting_unit,
    likely_causes,
    power_of_1000,
    unit_cure,
)
from kolsky.shot.records import ForceChannel, Shot, ShotBase

FRAME_INTERVALS = (1e-9, 5e-3)
"""Smallest and largest frame interval [s]: the fastest camera; an impact shorter than one interval."""
FORCE_STEPS = (1e-9, 1e-4)
"""Smallest and largest sampling interval of the force [s]: 10^4 to 10^9 samples per second."""
FRAME_STEPS = (1e-8, 1e-3)
"""Usual frame intervals [s]: cameras of bar tests take 10^3 to 10^8 pictures per second."""
FEWEST_FORCE_SAMPLES = 10
"""Smallest number of force samples during the frames; fewer give no force history."""
SHORTEST_RECORD = 10.0
"""Largest transit time through a bar over the duration of its record [-]; a shorter one has no reflection."""
LONGEST_FRAMES = 100.0
"""Largest duration of the frames over that of the force record [-]: it covers 1 % of the frames."""
IMPACT_SPEEDS = (0.05, 500.0)
"""Smallest and largest impact speed [m/s]: a fall of 0.2 mm gives 0.06; specimens disintegrate at 500."""
LEAST_TRAVEL = 1e-3
"""Smallest travel of the flyer, divided by the specimen's length [-]. Below it, the unit of displacement is
more likely wrong than the unit of time."""
RADIUS_TOLERANCE = 0.2
"""Largest difference between the outline at rest and the specimen's radius, relative to the radius [-]."""
STIFFENING = 30.0
"""Largest dynamic over quasi-static stress [-]: up to 10 times by strain rate, 3 times by sticking faces."""
INERTIA = 3.0
"""Largest inertial stress, divided by rho v^2 [-]. A stopped column has 1, its reflected front 2."""
SOFTENING = 1.0 / 30.0
"""Smallest dynamic over quasi-static stress [-]. A pre-conditioned or swollen specimen has 0.2."""
UNUSUAL = (0.2, 10.0)
"""Limits of dynamic stress divided by quasi-static stress for a warning [-]. Soft materials stiffen at most
10 times, and soften at most 5 times with conditioning."""
NOISE_SIGMAS = 10.0
"""A force below this many standard deviations of its baseline has not been transmitted yet."""
CROSSINGS = 2.0
"""Number of wave transits after which the force has arrived and stress is nearly uniform."""
SENSITIVITIES = (1e-6, 10.0)
"""Smallest and largest sensitivity of transducers with amplifiers [V/N], from load cells to soft sensors."""
SOFT_STRESSES = (1e3, 3e7)
"""Smallest and largest stress of a soft material at the end of a test [Pa], from gels to hard rubber."""
SHORTEST_CURVE = 0.03
"""Smallest ratio of the curve's last strain to the test's [-]; ratios declared as per cent are at 0.01."""
LONGEST_STRETCH = 8.0
"""Stretch above which a curve gets a warning [-]: natural rubber breaks at 7 to 8."""


Rule = Callable[[Evidence], Iterator[Finding]]


def _frame_rate(e: Evidence) -> Iterator[Finding]:
    """Check that the frame interval is that of a high-speed camera."""
    if e.frame_time is None or e.frame_time.size < 2:
        return
    step, count = float(np.median(np.diff(e.frame_time))), e.frame_time.size
    low, high = FRAME_INTERVALS
    if low <= step <= high:
        return
    factor = power_of_1000(
        step / 1e-5
    )  # a camera of such a test takes 100 000 per second, within a factor of 30
    yield e.finding(
        "frames.time",
        f"gives {count} frames at {1.0 / step:.4g} frames/s, {count * step:.4g} s in all: no camera of an"
        " impact test",
        allowed=f"times whose frames are {low:g} to {high:g} s apart",
        cure=unit_cure(e.file, "frames.time", "s", factor) or "check its column and unit",
    )


def _clocks(e: Evidence) -> Iterator[Finding]:
    """Check that frames and force were recorded during the same test."""
    if e.frame_time is None or e.force_time is None or e.frame_time.size < 2 or e.force_time.size < 2:
        return
    frames, force = float(np.ptp(e.frame_time)), float(np.ptp(e.force_time))
    step, frame_step = (float(np.median(np.diff(time))) for time in (e.force_time, e.frame_time))
    samples = frames / step
    both = f"the frames last {frames:.4g} s (frames.time), the force record lasts {force:.4g} s (force.time)"
    if samples >= FEWEST_FORCE_SAMPLES and frames <= LONGEST_FRAMES * force:
        return
    usual = FORCE_STEPS[0] <= step <= FORCE_STEPS[1], FRAME_STEPS[0] <= frame_step <= FRAME_STEPS[1]
    # The clock with an unusual step is named first. If both are equally unusual, the slower one is first.
    of_force = usual[1] if usual[0] != usual[1] else samples < FEWEST_FORCE_SAMPLES
    key, other, ratio = "frames.time", "force.time", frames / force
    if of_force:
        key, other, ratio = other, key, 1.0 / ratio
    factor = power_of_1000(ratio)
    if e.file.written(key) is None:  # a layout gives the clock
        key = key.removesuffix(".time")
    yield e.finding(
        key,
        f"contradicts {other}: {both}, with {samples:.3g} samples of force during all frames",
        cure=likely_causes(
            unit_cure(e.file, key, "s", factor) if key.endswith(".time") else "check the clock's unit",
            unit_cure(e.file, other, "s", 1.0 / factor),
        ),
    )


def _bar_clocks(e: Evidence) -> Iterator[Finding]:
    """Check that a bar's recorder resolves the transit time of a wave, and records at least that long."""
    for key, time in e.recorders.items():
        step, span = float(np.median(np.diff(time))), float(np.ptp(time))
        if step * FEWEST_FORCE_SAMPLES <= e.bar_transit <= SHORTEST_RECORD * span:
            continue
        # A recorder of such a test takes one sample per microsecond, within a factor of ten.
        factor = power_of_1000(step / 1e-6)
        written = e.file.written(f"{key}.time_unit")
        unit = None if written is None else fitting_unit(written, "s", factor)
        fits = likely_causes(
            "" if unit is None else f'{key}.time_unit = "{unit}" in place of "{written}" would fit',
            unit_cure(e.file, f"{key}.interval", "s", factor),
        )
        yield e.finding(
            key,
            f"has a sample every {step:.3g} s, {span:.3g} s in all, and a wave takes"
            f" {e.bar_transit:.3g} s through a bar (its length and wave speed in [bars])",
            allowed=f"{FEWEST_FORCE_SAMPLES} samples or more in that time, and a tenth of it in all",
            cure=fits
            or f"times {factor:g} times as large would fit: declare {key}.time_unit or {key}.interval",
        )


def _impact_speed(e: Evidence) -> Iterator[Finding]:
    """Check that the flyer's speed is that of an impact."""
    if e.travel is None or e.flyer_time is None or e.travel.size < 2:
        return
    length = e.declared.specimen.length
    speed, far = _speed(e), float(np.abs(e.travel).max())
    low, high = IMPACT_SPEEDS
    if low <= speed <= high or speed == 0.0 or far >= length:  # `_travel` names the cause of the latter
        return
    # The power of 1000 for a unit (time or displacement) with a value in the middle of the range.
    factor = power_of_1000(speed / 5.0)
    by_time = unit_cure(e.file, "frames.time", "s", 1.0 / factor)
    where = "flyer.displacement" if e.file.written("flyer") is not None else "surface.unit"
    by_path = unit_cure(e.file, where, "m", factor) if far * factor < length else ""
    small = far < LEAST_TRAVEL * length
    yield e.finding(
        where if small else "frames.time",
        f"gives a flyer of {speed:.3g} m/s (it moves {1e3 * far:.4g} mm by {where}, the frames last"
        f" {float(np.ptp(e.flyer_time)):.4g} s by frames.time)",
        allowed=f"such that it has {low:g} to {high:g} m/s",
        cure=likely_causes(*((by_path, by_time) if small else (by_time, by_path)))
        or "check the units of the displacement and of the times",
    )


def _speed(e: Evidence) -> float:
    """Largest speed of the flyer over a tenth of its record [m/s]. In single frames, noise would dominate."""
    assert e.travel is not None  # checked by the caller
    assert e.flyer_time is not None
    lag = max(1, e.travel.size // 10)
    moved = np.abs(e.travel[lag:] - e.travel[:-lag]) / (e.flyer_time[lag:] - e.flyer_time[:-lag])
    return float(moved.max()) if moved.size else 0.0


def _travel(e: Evidence) -> Iterator[Finding]:
    """Check that the flyer's travel is smaller than the specimen's length."""
    if e.travel is None:
        return
    length, far = e.declared.specimen.length, float(np.abs(e.travel).max())
    if far < length or e.file.written("flyer") is None:  # errors of pictures or surfaces have other causes
        return
    # A test compresses its specimen by at least a twentieth. For a column of frame numbers, no factor fits.
    factor = next((f for f in (1.0 / 25.4, 1e-3, 1e-6) if 0.05 * length <= far * f < length), 1.0)
    yield e.finding(
        "flyer.displacement",
        f"reaches {1e3 * far:.6g} mm, which exceeds the specimen's length ({1e3 * length:.6g} mm,"
        " specimen.length)",
        cure=likely_causes(
            "" if factor == 1.0 else unit_cure(e.file, "flyer.displacement", "m", factor),
            "" if factor == 1.0 else unit_cure(e.file, "specimen.length", "m", 1.0 / factor, SPECIMEN_SIZES),
            "is flyer.displacement the right column?",
        ),
    )


def _outline_size(e: Evidence) -> Iterator[Finding]:
    """Check that the outline at rest has the specimen's radius and height."""
    if e.outline is None or e.rest is None:
        return
    static = e.outline.time <= e.rest
    if not static.any():
        return
    radius, length = 0.5 * e.declared.specimen.diameter, e.declared.specimen.length
    y, z = e.outline.y[static], e.outline.Z[static]
    middle, top = float(np.median(z)), float(y.max())
    table = "centre_line" if e.file.written("centre_line") is not None else "surface"
    source = e.file.written(f"{table}.file") or e.file.written(f"{table}.pattern") or "the pictures"
    if abs(middle - radius) > RADIUS_TOLERANCE * radius:
        yield e.finding(
            "specimen.diameter",
            f"contradicts {table} ({source}): Z from the axis is {1e3 * middle:.4g} mm (median of the"
            " static frames),"
            f" and the radius {1e3 * radius:.4g} mm; they must agree within {100 * RADIUS_TOLERANCE:g} %",
            cure=_radius_cure(e, table, middle, y),
        )
    elif top <= 0.0 or (factor := fitting_factor(top / length, LENGTH_FACTORS, tolerance=0.3)) is None:
        return
    elif not 0.7 <= top / length <= 1.1:  # the outline may end below the flyer's face
        if factor in (2.0, 0.5):
            return  # an outline of half the height was cut
        yield e.finding(
            "specimen.length",
            f"contradicts {table} ({source}): the outline at rest reaches y = {1e3 * top:.4g} mm above the"
            f" transmission platen, the length is {1e3 * length:.6g} mm",
            cure=likely_causes(
                unit_cure(e.file, f"{table}.y", "m", factor),
                unit_cure(e.file, "specimen.length", "m", 1.0 / factor, SPECIMEN_SIZES),
            ),
        )


def _radius_cure(e: Evidence, table: str, middle: float, y: FloatArray) -> str:
    """The likely causes of an outline with a wrong radius, the likeliest first."""
    radius, length = 0.5 * e.declared.specimen.diameter, e.declared.specimen.length
    factor = fitting_factor(middle / radius, LENGTH_FACTORS, tolerance=RADIUS_TOLERANCE)
    offset = radius - middle + getattr(getattr(e.declared, "centre_line", None), "Z_offset", 0.0)
    by_offset = (
        f'centre_line.Z_offset = "{round(1e3 * offset, 3) + 0.0:g} mm" would fit if Z does not begin at the'
        " axis"
        if table == "centre_line"
        else "check surface.origin and surface.unit"
    )
    assert e.outline is not None  # checked by the caller
    heights = e.outline.Z
    swapped = (
        abs(float(np.median(y)) - radius) <= RADIUS_TOLERANCE * radius
        and -0.1 * length <= heights.min()
        and heights.max() <= 1.1 * length
    )
    causes = [by_offset, "is it the right column, and are y and Z swapped?"]
    if swapped:
        causes = ["are y and Z swapped?", by_offset]
    elif abs(middle + radius) <= RADIUS_TOLERANCE * radius:
        causes = [f"Z counts toward the cameras: reverse the sign of {table}.Z in the file", by_offset]
    elif factor == 0.5:
        wider = f'specimen.diameter = "{4e3 * radius:.6g} mm" would fit: was the radius given?'
        causes = [wider, f"{table}.Z may hold the diameter", by_offset]
    elif factor == 2.0:
        half = f'specimen.diameter = "{1e3 * radius:.6g} mm" would fit: was twice the diameter given?'
        causes = [half, by_offset]
    elif factor is not None:
        of_diameter = unit_cure(e.file, "specimen.diameter", "m", 1.0 / factor, SPECIMEN_SIZES)
        causes = [unit_cure(e.file, f"{table}.Z", "m", factor), of_diameter, by_offset]
    return likely_causes(*causes)


def _curve_reach(e: Evidence) -> Iterator[Finding]:
    """Check that the curve's strains fit the test, and are not per cent declared as ratios."""
    if e.curve is None or e.curve.law is not None:
        return
    end = float(e.curve.stretch[-1])
    if end > LONGEST_STRETCH:
        message = f"reaches a stretch of {end:.4g}; rubber breaks at {LONGEST_STRETCH:g}"
        cure = unit_cure(e.file, "curve.strain", "1", 0.01) or "check its column and unit"
        yield e.finding("curve.strain", message, cure=cure, contradiction=False)
    if e.travel is None:
        return
    strain = float(np.abs(e.travel).max()) / e.declared.specimen.length
    share = abs(end - 1.0) / strain if strain > 0.0 else 1.0
    if share < SHORTEST_CURVE:
        yield e.finding(
            "curve.strain",
            f"ends at {abs(end - 1.0):.3g}, and the flyer strains the specimen by {strain:.3g}"
            " (flyer over specimen.length)",
            cure=unit_cure(e.file, "curve.strain", "1", 100.0) or "check its unit; export the whole ramp",
            contradiction=False,
        )


def quasi_static_stress(curve: MaterialCurve, strain: float) -> tuple[float, float]:
    """Smallest and largest compressive nominal stress at a strain [Pa], as magnitudes.

    Each point of the curve gives the modulus mu of a neo-Hookean material with that stress,
    sigma = mu (lambda - lambda^-2). The smallest and the largest mu give the stresses at ``strain``.
    """
    loaded = curve.stretch != 1.0
    stretch = curve.stretch[loaded]
    moduli = np.abs(curve.stress[loaded] / (stretch - stretch**-2.0))
    reached = max(1.0 - strain, 0.05)  # a body is not compressed to zero length
    size = abs(reached - reached**-2.0)
    return float(moduli.min() * size), float(moduli.max() * size)


def _force_over_area(e: Evidence) -> Iterator[Finding]:
    """Check force over area against the curve's stress, with allowance for rate, ends and inertia."""
    if e.force is None or e.travel is None or e.curve is None or e.flyer_time is None or e.rest is None:
        return
    assert e.force_time is not None  # it comes with the force
    specimen = e.declared.specimen
    during = (e.force_time >= e.rest) & (e.force_time <= e.flyer_time[-1])
    strain = float(np.abs(e.travel).max()) / specimen.length
    if not during.any() or strain <= 0.0:
        return
    peak = float(e.force[during].max())
    if peak < NOISE_SIGMAS * e.force_noise:
        return
    area = 0.25 * math.pi * specimen.diameter**2
    measured = peak / area
    least, most = quasi_static_stress(e.curve, strain)
    inertia = specimen.density * _speed(e) ** 2
    modulus = 3.0 * most / abs((1.0 - min(strain, 0.95)) ** -2.0 - (1.0 - min(strain, 0.95)))
    speed = math.sqrt(modulus / specimen.density)
    arrived = float(e.flyer_time[-1]) - e.rest >= CROSSINGS * specimen.length / speed
    high = measured > STIFFENING * most + INERTIA * inertia
    low = arrived and measured < SOFTENING * least
    odd_high = measured > UNUSUAL[1] * most + INERTIA * inertia
    odd_low = arrived and measured < UNUSUAL[0] * least
    if not (high or low or odd_high or odd_low):
        return
    key = "curve.stress" if e.curve.law is None else "law.parameters"
    factor = power_of_1000(math.sqrt(least * most) / measured)
    causes = []
    if factor != 1.0:
        causes = [
            unit_cure(e.file, "curve.stress", "Pa", factor) if e.curve.law is None else "check its constants",
            unit_cure(e.file, "force.sensitivity", "V/N", factor, SENSITIVITIES),
        ]
        if SOFT_STRESSES[0] <= most <= SOFT_STRESSES[1] and not (
            SOFT_STRESSES[0] <= measured <= SOFT_STRESSES[1]
        ):
            causes.reverse()  # the curve is that of a soft material, the force over area is not
    if e.curve.law is None and abs(float(e.curve.stretch[-1]) - 1.0) < SHORTEST_CURVE * strain:
        causes.insert(0, unit_cure(e.file, "curve.strain", "1", 100.0))
    yield e.finding(
        key,
        f"gives {1e-3 * most:.3g} kPa at the test's strain of {strain:.2g} (largest stress of the curve"
        f" {1e-3 * np.abs(e.curve.stress).max():.3g} kPa), and the largest force of {peak:.4g} N"
        f" (force.sensitivity) over the area by specimen.diameter is {1e-3 * measured:.3g} kPa,"
        f" {measured / most:.3g} times as much",
        allowed=f"within {SOFTENING:.2g} to {STIFFENING:g} times" if high or low else None,
        cure=likely_causes(*causes)
        or "check curve.stress, force.sensitivity and specimen.diameter; a true ratio needs no change",
        contradiction=high or low,
    )


RULES: tuple[Rule, ...] = (
    check_unit_of_heading,
    check_densities,
    check_bar_speeds,
    check_specimen_size,
    check_channels,
    _frame_rate,
    _clocks,
    _bar_clocks,
    _travel,
    _impact_speed,
    _outline_size,
    _curve_reach,
    _force_over_area,
)
"""All rules; causes are named in this order."""


def gate(evidence: Evidence) -> tuple[str, ...]:
    """Reject contradictions and return the warnings, one sentence each.

    Raises InputError for a contradiction, `InputErrors` for several.
    """
    found = [finding for rule in RULES for finding in rule(evidence)]
    refuse([error for error, contradiction in found if contradiction])
    return tuple(str(error) for error, contradiction in found if not contradiction)


def evidence_of(shot: ShotBase) -> Evidence | None:
    """The evidence of a loaded shot, on the shot's clock; None if it was not read from a shot file."""
    if shot.file is None:
        return None
    declared = getattr(shot.file, "declared", shot)  # of bars the shot holds all that the rules ask for
    records: dict[str, Any] = {"curve": shot.curve}
    if isinstance(shot.force, ForceChannel):
        sensitivity = shot.force.transducer.sensitivity
        records |= {
            "force_time": shot.force.time,
            "force": shot.force.raw_force(),
            "force_noise": float(shot.force.baseline_volts().std(ddof=1)) / sensitivity,
        }
    if isinstance(shot, Shot):
        records |= {"rest": shot.window[0], "outline": shot.centre_line}
        if isinstance(shot.flyer, FlyerMotion):
            records |= travel_of(shot.flyer, shot.window[0]) | {"frame_time": shot.flyer.time}
    return Evidence(file=shot.file, declared=declared, **records)


def with_warnings(shot: Shot) -> Shot:
    """The shot with warnings about unlikely inputs added to its notes.

    Raises InputError for a contradiction.
    """
    known = evidence_of(shot)
    return shot if known is None else replace(shot, notes=(*shot.notes, *gate(known)))


def travel_of(flyer: FlyerMotion, rest: float) -> dict[str, Any]:
    """Times and travel of a flyer, as fields of `Evidence`. ``rest``: time of the last static frame [s]."""
    static = flyer.time <= rest
    zero = float(np.median(flyer.displacement[static])) if static.any() else 0.0
    return {"flyer_time": flyer.time, "travel": flyer.displacement - zero}
