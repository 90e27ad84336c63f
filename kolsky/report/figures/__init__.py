"""Figures of every page by file; a new one is its file and its entry in one of the registries below."""

from collections.abc import Iterable, Mapping
from importlib import import_module
from typing import Any

from kolsky.report.figures.base import FigureKind

__all__ = [
    "ACTUATORS",
    "BARS_TOGETHER",
    "BAR_CHECKS",
    "BASELINES",
    "BUDGETS",
    "CALIBRATION",
    "CHECKS",
    "CHECK_RUNS",
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


PLACES: dict[str, tuple[str, ...]] = {
    # Several shots identified together
    "JOINT": ("joint.FIGURES",),
    # Recordings behind an identification; shown before those of `REGISTRY`
    "RECORDINGS": ("recordings.FIGURES",),
    # Check run of an identification: those of `REGISTRY` that show nothing else
    "CHECK_RUNS": ("comparison.FIGURES", "simulation.FIGURES"),
    # Identification
    "REGISTRY": ("comparison.FIGURES", "misfit.FIGURES", "uncertainty.FIGURES", "simulation.FIGURES"),
    # Surfaces measured by image correlation
    "SURFACES": ("surface_points.FIGURES", "surface_motion.FIGURES", "speckles.FIGURES"),
    # Stereo calibration
    "CALIBRATION": ("calibration.FIGURES",),
    # Shot before anything is run
    "CHECKS": ("checked.FIGURES",),
    # Shot whose pictures are not correlated yet
    "PICTURE_CHECKS": ("checked.OF_PICTURES",),
    # Test between bars before it is reduced
    "BAR_CHECKS": ("waves.CHECKED_BARS",),
    # Speckle pattern of one camera
    "SPECKLES": ("speckles.SPECKLE_FLOOR",),
    # Reduction of a test between bars
    "WAVES": ("waves.FIGURES",),
    # Classical reduction of a flyer test
    "FLYER_TESTS": ("flyer_test.FIGURES",),
    # Measurement by image correlation alone
    "FULL_FIELDS": ("full_field.FIGURES",),
    # Shot with the bars together
    "BARS_TOGETHER": ("waves.BARS_TOGETHER",),
    # Repeated tests
    "REPEATS": ("waves.REPEATED_TESTS",),
    # Plan of an experiment
    "PLANS": ("plan.FIGURES",),
    # Planned test
    "PREDICTIONS": ("prediction.FIGURES",),
    # Scan of a planned test
    "SCANS": ("prediction.SCAN_FIGURES",),
    # Group of shots compared over their strain rates
    "RATES": ("rates.FIGURES", "rate_curves.FIGURES"),
    # Trends of a shot, Figs. 7 to 10 of Mates et al. (2012)
    "TRENDS": ("trends.FIGURES",),
    # Reference curve from quasi-static tests
    "BASELINES": ("material.REFERENCE_CURVE",),
    # Laws fitted to homogeneous tests
    "MATERIALS": ("material.FIGURES",),
    # Global sensitivity of a shot
    "SENSITIVITY": ("sensitivity.FIGURES",),
    # Design of experiments over a shot's parameters
    "SWEEPS": ("sweep.FIGURES",),
    # Error budget
    "BUDGETS": ("budget.FIGURES",),
    # Moduli of tests of every kind over their time scales
    "MODULI": ("rate_curves.MODULI",),
    # Slow tests and shots on one axis of time
    "RELAXATIONS": ("relaxation.FIGURES",),
    # Whole specimens fitted to forces
    "SPECIMENS": ("specimen.FIGURES",),
    # Sheet fitted to a displacement field
    "SHEETS": ("sheet.FIGURES",),
    # Pressurised actuator
    "ACTUATORS": ("actuator.FIGURES",),
}
"""Files and names of the figures of each registry; a file is loaded when one of its registries is asked
for, since a command shows one page."""

SHOWN_BY: dict[str, str] = {
    "dic.calibration.result.Calibration": "CALIBRATION",
    "dic.chain.speckle_report.Speckles": "SPECKLES",
    "kolsky.bars.guides.bars_together.BarsTogether": "BARS_TOGETHER",
    "kolsky.bars.reduction.repeated_tests.RepeatedTests": "REPEATS",
    "kolsky.bars.result.FlyerResult": "FLYER_TESTS",
    "kolsky.bars.result.WavesResult": "WAVES",
    "kolsky.inverse.check_run.CheckRun": "CHECK_RUNS",
    "kolsky.inverse.result.Identification": "REGISTRY",
    "kolsky.joint.records.JointResult": "JOINT",
    "kolsky.joint.slow_dynamics.SlowDynamics": "RELAXATIONS",
    "kolsky.material.fits.compare.Comparison": "MATERIALS",
    "kolsky.material.reference_curve.ReferenceCurve": "BASELINES",
    "kolsky.report.actuator_view.ActuatorView": "ACTUATORS",
    "kolsky.report.full_field_view.FullFieldView": "FULL_FIELDS",
    "kolsky.report.specimen_view.SheetView": "SHEETS",
    "kolsky.report.specimen_view.SpecimenView": "SPECIMENS",
    "kolsky.report.surface_view.SurfaceView": "SURFACES",
    "kolsky.prediction.predict.Prediction": "PREDICTIONS",
    "kolsky.shot.recorded.Recorded": "RECORDINGS",
    "kolsky.shot.bar_check.CheckedBars": "BAR_CHECKS",
    "kolsky.shot.records.PicturedShot": "PICTURE_CHECKS",
    "kolsky.shot.records.Shot": "CHECKS",
    "kolsky.studies.budget.records.Budget": "BUDGETS",
    "kolsky.studies.global_sensitivity.GlobalSensitivity": "SENSITIVITY",
    "kolsky.studies.planning.plan.Plan": "PLANS",
    "kolsky.studies.rates.records.GroupRates": "RATES",
    "kolsky.studies.sweep_analysis.SweepAnalysis": "SWEEPS",
    "kolsky.studies.trends.Trends": "TRENDS",
}
"""Registries by the class of what their figures show."""


def __getattr__(name: str) -> Registry:
    """Load a registry of `PLACES` when it is first asked for."""
    if name not in PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    found = by_name(*map(_figures, PLACES[name]))
    globals()[name] = found
    return found


def _figures(place: str) -> Iterable[FigureKind[Any]]:
    """Figures of one file, "file.NAME": those of a list, or the one."""
    file, _, name = place.partition(".")
    found = getattr(import_module(f"{__name__}.{file}"), name)
    return (found,) if isinstance(found, FigureKind) else found


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
    registry = SHOWN_BY[name]
    found: Registry = globals()[registry] if registry in globals() else __getattr__(registry)
    return found
