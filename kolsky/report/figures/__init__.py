"""Figures of every page by file; a new one is its file and its entry in one of the registries below."""

from collections.abc import Iterable, Mapping
from typing import Any

from kolsky.report.figures import (
    actuator,
    budget,
    calibration,
    checked,
    comparison,
    flyer_test,
    full_field,
    joint,
    material,
    misfit,
    plan,
    prediction,
    rate_curves,
    rates,
    recordings,
    relaxation,
    sensitivity,
    sheet,
    simulation,
    specimen,
    speckles,
    surface_motion,
    surface_points,
    sweep,
    trends,
    uncertainty,
    waves,
)
from kolsky.report.figures.base import FigureKind

__all__ = [
    "ACTUATORS",
    "BARS_TOGETHER",
    "BAR_CHECKS",
    "BASELINES",
    "BUDGETS",
    "CALIBRATION",
    "CHECKS",
    "FLYER_TESTS",
    "FULL_FIELDS",
    "JOINT",
    "MATERIALS",
    "MODULI",
    "PICTURE_CHECKS",
    "PLANS",
    "PREDICTIONS",
    "RATES",
    "RECORDINGS",
    "REGISTRY",
    "RELAXATIONS",
    "REPEATS",
    "SCANS",
    "SENSITIVITY",
    "SHEETS",
    "SHOWN_BY",
    "SPECIMENS",
    "SPECKLES",
    "SURFACES",
    "SWEEPS",
    "TRENDS",
    "WAVES",
    "FigureKind",
    "figures_of",
]

Registry = Mapping[str, FigureKind[Any]]
"""Figures of one page by name, in the order in which the page shows them."""


def by_name(*files: Iterable[FigureKind[Any]]) -> Registry:
    """Return the figures of several files as one registry.

    Raises
    ------
    ValueError
        If two figures have the same name.
    """
    found: dict[str, FigureKind[Any]] = {}
    for kind in (kind for figures in files for kind in figures):
        if kind.name in found:
            raise ValueError(f"two figures of one page are called {kind.name!r}; rename one of them")
        found[kind.name] = kind
    return found


JOINT = by_name(joint.FIGURES)
"""Several shots identified together."""
RECORDINGS = by_name(recordings.FIGURES)
"""Recordings behind an identification; shown before those of `REGISTRY`."""
REGISTRY = by_name(comparison.FIGURES, misfit.FIGURES, uncertainty.FIGURES, simulation.FIGURES)
"""Identification."""
SURFACES = by_name(surface_points.FIGURES, surface_motion.FIGURES, speckles.FIGURES)
"""Surfaces measured by image correlation."""
CALIBRATION = by_name(calibration.FIGURES)
"""Stereo calibration."""
CHECKS = by_name(checked.FIGURES)
"""Shot before anything is run."""
PICTURE_CHECKS = by_name(checked.OF_PICTURES)
"""Shot whose pictures are not correlated yet."""
BAR_CHECKS = by_name([waves.CHECKED_BARS])
"""Test between bars before it is reduced."""
SPECKLES = by_name([speckles.SPECKLE_FLOOR])
"""Speckle pattern of one camera."""
WAVES = by_name(waves.FIGURES)
"""Reduction of a test between bars."""
FLYER_TESTS = by_name(flyer_test.FIGURES)
"""Classical reduction of a flyer test."""
FULL_FIELDS = by_name(full_field.FIGURES)
"""Measurement by image correlation alone."""
BARS_TOGETHER = by_name([waves.BARS_TOGETHER])
"""Shot with the bars together."""
REPEATS = by_name([waves.REPEATED_TESTS])
"""Repeated tests."""
PLANS = by_name(plan.FIGURES)
"""Plan of an experiment."""
PREDICTIONS = by_name(prediction.FIGURES)
"""Planned test."""
SCANS = by_name(prediction.SCAN_FIGURES)
"""Scan of a planned test."""
RATES = by_name(rates.FIGURES, rate_curves.FIGURES)
"""Group of shots compared over their strain rates."""
TRENDS = by_name(trends.FIGURES)
"""Trends of a shot, Figs. 7 to 10 of Mates et al. (2012)."""
BASELINES = by_name([material.REFERENCE_CURVE])
"""Reference curve from quasi-static tests."""
MATERIALS = by_name(material.FIGURES)
"""Laws fitted to homogeneous tests."""
SENSITIVITY = by_name(sensitivity.FIGURES)
"""Global sensitivity of a shot."""
SWEEPS = by_name(sweep.FIGURES)
"""Design of experiments over a shot's parameters."""
BUDGETS = by_name(budget.FIGURES)
"""Error budget."""
MODULI = by_name([rate_curves.MODULI])
"""Moduli of tests of every kind over their time scales."""
RELAXATIONS = by_name(relaxation.FIGURES)
"""Slow tests and shots on one axis of time."""
SPECIMENS = by_name(specimen.FIGURES)
"""Whole specimens fitted to forces."""
SHEETS = by_name(sheet.FIGURES)
"""Sheet fitted to a displacement field."""

ACTUATORS = by_name(actuator.FIGURES)
"""Pressurised actuator."""

SHOWN_BY: dict[str, Registry] = {
    "dic.calibration.result.Calibration": CALIBRATION,
    "dic.chain.speckle_report.Speckles": SPECKLES,
    "kolsky.bars.guides.bars_together.BarsTogether": BARS_TOGETHER,
    "kolsky.bars.reduction.repeated_tests.RepeatedTests": REPEATS,
    "kolsky.bars.result.FlyerResult": FLYER_TESTS,
    "kolsky.bars.result.WavesResult": WAVES,
    "kolsky.inverse.result.Identification": REGISTRY,
    "kolsky.joint.records.JointResult": JOINT,
    "kolsky.joint.slow_dynamics.SlowDynamics": RELAXATIONS,
    "kolsky.material.fits.compare.Comparison": MATERIALS,
    "kolsky.material.reference_curve.ReferenceCurve": BASELINES,
    "kolsky.report.actuator_view.ActuatorView": ACTUATORS,
    "kolsky.report.full_field_view.FullFieldView": FULL_FIELDS,
    "kolsky.report.specimen_view.SheetView": SHEETS,
    "kolsky.report.specimen_view.SpecimenView": SPECIMENS,
    "kolsky.report.surface_view.SurfaceView": SURFACES,
    "kolsky.prediction.predict.Prediction": PREDICTIONS,
    "kolsky.shot.recorded.Recorded": RECORDINGS,
    "kolsky.shot.bar_check.CheckedBars": BAR_CHECKS,
    "kolsky.shot.records.PicturedShot": PICTURE_CHECKS,
    "kolsky.shot.records.Shot": CHECKS,
    "kolsky.studies.budget.records.Budget": BUDGETS,
    "kolsky.studies.global_sensitivity.GlobalSensitivity": SENSITIVITY,
    "kolsky.studies.planning.plan.Plan": PLANS,
    "kolsky.studies.rates.records.GroupRates": RATES,
    "kolsky.studies.sweep_analysis.SweepAnalysis": SWEEPS,
    "kolsky.studies.trends.Trends": TRENDS,
}
"""Registries by the class of what their figures show."""


def figures_of(shown: Any) -> Registry:
    """Figures that show a result.

    Parameters
    ----------
    shown
        A result, e.g. a `kolsky.inverse.result.Identification`.

    Returns
    -------
    Registry
        The figures by name; each has a `caption` of the result.

    Raises
    ------
    TypeError
        If no figure shows things of this class.
    """
    name = f"{type(shown).__module__}.{type(shown).__qualname__}"
    if name not in SHOWN_BY:
        known = ", ".join(sorted(known.rpartition(".")[2] for known in SHOWN_BY))
        raise TypeError(f"no figure shows a {type(shown).__name__}; there are figures of {known}")
    return SHOWN_BY[name]
