"""Reduction of a test between bars: strain, windows, waves at the faces, corrections, budget."""

from collections.abc import Callable, Mapping
from dataclasses import replace

from numpy.typing import ArrayLike

from kolsky.bars.audit import AuditLog
from kolsky.bars.budget import Budget, propagate
from kolsky.bars.records import (
    BarSignal,
    FaceWaves,
    Reduction,
    WavesResult,
    Windows,
    histories,
    map_histories,
    with_opposite_sign,
)
from kolsky.bars.reduction import summary as quoted
from kolsky.bars.reduction.inertia import corrections_that_act, valid_span
from kolsky.bars.reduction.separation import KEY as FREE_END
from kolsky.bars.reduction.separation import check_length, free_end_limits, free_ends, overlapping_windows
from kolsky.bars.reduction.stress_strain import TRUE, true_curve
from kolsky.bars.reduction.summary import Summary, summarise
from kolsky.bars.reduction.varied_test import VariedTest, bar_correlations, budget_quantities, station_of
from kolsky.bars.reduction.windows import (
    FAR,
    NO_PART,
    SIDES,
    Alignment,
    WavesInput,
    alignments,
    check_baselines,
    check_windows,
    find_windows,
    incident_arrival,
)
from kolsky.bars.reduction.windows import KEYS as ALIGNMENT_KEYS
from kolsky.bars.signals.stations import Station
from kolsky.base.arrays import FloatArray

LARGEST_BEND = 1.0
"""Largest disagreement of the budget's two steps, in combined standard uncertainties. A wave speed shifts
steep fronts, which is nonlinear. `quoted_values.remarks` names the affected values."""
Progress = Callable[[str, int, int], None]


def analyse(given: WavesInput, *, progress: Progress = lambda stage, done, total: None) -> WavesResult:
    """Reduce a classical test, with a list of all corrections and propagated uncertainty.

    Raises ValueError if the signals do not contain such a test; see the modules in `kolsky.bars`.
    """
    progress("waves", 0, 3)
    tension = given.load == "tension"
    best = {side: station_of(given, side) for side in SIDES}
    incident, transmission = (best[side].signal for side in SIDES)
    arrival = incident_arrival(incident, tension=tension)
    windows = _windows(given, incident, transmission, tension)
    check_baselines(given, incident, transmission, tension=tension)
    checks = check_windows(incident, transmission, tension=tension)
    best = {side: station_of(given, side, windows=windows) for side in SIDES}
    progress("waves", 1, 3)

    log = AuditLog(given.switches)
    for side in SIDES:
        log.add(*best[side].corrections)
    ends = free_ends(incident, arrival.time) if given.switches[FREE_END] else None
    varied = VariedTest(given, windows, arrival.time, ends=ends)
    plain, carried = varied.carried({}, dispersive=False), varied.carried({}, dispersive=True)
    _log_dispersion(log, plain, carried, given)
    if ends is not None:
        _log_free_end(log, replace(varied, ends=None).carried({}, dispersive=True), carried, given)
    varied = _aligned(varied, log, carried, alignments(arrival, checks, given.switches))
    faces = varied.faces({}, log)
    uncorrected, _ = varied.reduced(faces, {})
    acts = corrections_that_act(uncorrected, given.specimen, given.bars, given.switches, share=given.share)
    valid = valid_span(uncorrected, given.specimen, given.bars, share=given.share, tension=tension)
    varied = replace(varied, inertia=acts)
    reduction, corrections = varied.reduced(faces, {})
    log.add(*corrections)
    log.complete(_left_out(given))
    summary = summarise(
        reduction,
        faces,
        given.specimen,
        analysis=given.analysis,
        allowance=given.allowance,
        share=given.plateau,
    )
    progress("waves", 2, 3)

    budget, summary = _budget_with_means(varied, best, reduction, summary)
    reduction = map_histories(reduction, lambda name, history: budget.history(name, history.unit))
    progress("waves", 3, 3)
    sign, soft = -1.0 if tension else 1.0, acts["radial inertia"].startswith("on: the specimen is soft")
    return WavesResult(
        name=given.name,
        specimen=given.specimen,
        load=given.load,
        incident=incident,
        transmission=transmission,
        windows=windows,
        faces=faces,
        reduction=with_opposite_sign(reduction) if tension else reduction,
        corrections=log.corrections,
        budget=quoted.table(budget, sign),
        facts=quoted.facts(best, arrival, checks, windows, reduction, summary),
        remarks=(
            *given.notes,
            *quoted.remarks(reduction, budget, checks, given, summary),
            *((f"validity of the curve: {valid.sentence}",) if soft and valid.nearly_empty else ()),
        ),
        analysis=given.analysis,
        valid=valid.window,
        validity=valid.sentence,
        inputs=given.inputs,
        settings=given.settings,
        extra=_true_histories(budget, sign),
    )


def _windows(given: WavesInput, incident: BarSignal, transmission: BarSignal, tension: bool) -> Windows:
    """Windows from the shot file, from travel times, or for pulses that overlap at two stations."""
    if given.windows is None and FAR in given.stations and given.switches["separation"]:
        return overlapping_windows(incident, station_of(given, FAR).signal, transmission, tension=tension)
    if not given.switches[FREE_END]:
        return find_windows(incident, transmission, tension=tension, manual=given.windows)
    ends = free_end_limits(incident, transmission)
    found = find_windows(incident, transmission, tension=tension, manual=given.windows, ends=ends)
    check_length(found, ends)
    return found


def _left_out(given: WavesInput) -> dict[str, str]:
    """Reason why a correction without an entry does not apply to a test between bars."""
    return {
        "bridge nonlinearity": "no bridge is declared: the gauges' calibrations are stated factors",
        FREE_END: "off by default: the windows end before an echo from a far end",
        "bending": "one gauge at each station; two opposed gauges would separate bending",
        "separation": "one station on the incident bar, whose pulses do not overlap",
        **NO_PART,
    }


def _log_free_end(log: AuditLog, plain: FaceWaves, carried: FaceWaves, given: WavesInput) -> None:
    for wave, side in (("reflected", "incident"), ("transmitted", "transmission")):
        bar, distance = given.bars[side], given.stations[side].position
        log.compare(
            f"free end, {wave} wave",
            FREE_END,
            getattr(plain, wave),
            getattr(carried, wave),
            applied=True,
            unit="1",
            reason=(
                f"echo over twice {1e3 * (bar.length - distance):.4g} mm of the {side} bar, whose far end is "
                "taken as free: the striker has left it"
            ),
        )


def _aligned(
    varied: VariedTest,
    log: AuditLog,
    carried: FaceWaves,
    found: tuple[Mapping[str, Alignment], Mapping[str, str]],
) -> VariedTest:
    """The test with the active alignments. Each is listed with its effect."""
    possible, missing = found
    both = replace(varied, aligned=possible).carried({}, dispersive=True)
    for wave, alignment in possible.items():
        log.choose(
            f"alignment, {wave} wave",
            ALIGNMENT_KEYS[wave],
            getattr(carried, wave),
            getattr(both, wave),
            unit="1",
            reason=(
                f"observed {1e6 * alignment.late:+.3g} us from its predicted arrival, standard uncertainty "
                f"{1e6 * alignment.sigma:.2g} us"
            ),
        )
    log.complete({ALIGNMENT_KEYS[wave]: why for wave, why in missing.items()})
    on = {wave: a for wave, a in possible.items() if varied.given.switches[ALIGNMENT_KEYS[wave]]}
    return replace(varied, aligned=on)


def _log_dispersion(log: AuditLog, plain: FaceWaves, carried: FaceWaves, given: WavesInput) -> None:
    for wave, side in (("incident", "incident"), ("reflected", "incident"), ("transmitted", "transmission")):
        bar, distance = given.bars[side], given.stations[side].position
        log.choose(
            f"dispersion, {wave} wave",
            "dispersion",
            getattr(plain, wave),
            getattr(carried, wave),
            unit="1",
            reason=(
                f"first mode of a bar of {1e3 * bar.diameter:.4g} mm with nu = {bar.poisson:g} over "
                f"{1e3 * distance:.4g} mm, against a shift at {bar.wave_speed:.1f} m/s"
            ),
        )


def _budget_with_means(
    varied: VariedTest, best: Mapping[str, Station], reduction: Reduction, summary: Summary
) -> tuple[Budget, Summary]:
    """The budget. Means that jump within the inputs' uncertainty are not reported."""
    try:
        return _budget(varied, best, reduction, summary), summary
    except ValueError as error:
        name = str(error).partition(":")[0]
        if name not in ("mean stress", "mean rate"):
            raise
        reason = f"no plateau: the {name} jumps within the uncertainty of its inputs"
        plateau = replace(summary.plateau, span=None, reason=reason, stress_fault=reason, rate_fault=reason)
        without = replace(summary, plateau=plateau, mean_stress=None, mean_rate=None)
        return _budget(varied, best, reduction, without), without


def _budget(
    varied: VariedTest, best: Mapping[str, Station], reduction: Reduction, summary: Summary
) -> Budget:
    """Uncertainties of all histories and reported results."""
    quantities = budget_quantities(varied.given, best)
    quantities += [alignment.quantity for alignment in varied.aligned.values()]
    quantities += quoted.span_quantities(summary)
    noise: dict[str, ArrayLike] = {
        **{name: history.sigma for name, history in histories(reduction).items()},
        **{name: history.sigma for name, history in true_curve(reduction, summary.analysis).items()},
        **quoted.noise(reduction, summary),
    }
    found = propagate(
        lambda values: varied.outputs(values, summary),
        quantities,
        noise=noise,
        correlations=bar_correlations(varied.given, quantities),
        tolerance=LARGEST_BEND,
    )
    return quoted.with_both_sides(found)


def _true_histories(budget: Budget, sign: float) -> dict[str, FloatArray]:
    """True strain and stress with their standard uncertainties. `sign` -1 makes tension positive."""
    found = {}
    for name, unit in TRUE.items():
        history = budget.history(name, unit)
        found[f"{name} ({unit})"] = sign * history.value
        found[f"sigma of {name} ({unit})"] = history.sigma
    return found
