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
    "RECORDINGS": ("recordings.RECORDED",),
    # Check run of an identification: those of `REGISTRY` that show nothing else
    # Identification
    "REGISTRY": ("comparison.COMPARISON", "misfit.MISFIT", "misfit.UNCERTAINTY", "comparison.SIMULATION"),
    # Surfaces measured by image correlation
    "SURFACES": ("surface_points.SURFACE_POINTS", "surface_motion.FIGURES", "surface_points.SPECKLE_OVERLAY"),
    # Stereo calibration
    "CALIBRATION": ("calibration.FIGURES",),
    # Shot before anything is run
    "CHECKS": ("recordings.CHECKED",),
    # Shot whose pictures are not correlated yet
    "PICTURE_CHECKS": ("recordings.CHECKED_PICTURES",),
    # Test between bars before it is reduced
    "BAR_CHECKS": ("waves.CHECKED_BARS",),
    # Speckle pattern of one camera
    "SPECKLES": ("surface_points.SPECKLE_FLOOR",),
    # Reduction of a test between bars
    "WAVES": ("waves.REDUCTION",),
    # Classical reduction of a flyer test
    "FLYER_TESTS": ("waves.FLYER_TEST",),
    # Measurement by image correlation alone
    "FULL_FIELDS": ("surface_points.FULL_FIELD",),
    # Shot with the bars together
    "BARS_TOGETHER": ("waves.BARS_TOGETHER",),
    # Repeated tests
    "REPEATS": ("waves.REPEATED_TESTS",),
    # Plan of an experiment
    "PLANS": ("planning.PLANNED",),
    # Planned test
    "PREDICTIONS": ("planning.PREDICTED",),
    # Scan of a planned test
    "SCANS": ("planning.SCANNED",),
    # Group of shots compared over their strain rates
    "RATES": ("rates.SLOPES", "rates.EQUAL_STRAIN"),
    # Trends of a shot, Figs. 7 to 10 of Mates et al. (2012)
    "TRENDS": ("studies.TREND_FIGURES",),
    # Reference curve from quasi-static tests
    "BASELINES": ("material.REFERENCE_CURVE",),
    # Laws fitted to homogeneous tests
    "MATERIALS": ("material.FITTED_LAWS",),
    # Global sensitivity of a shot
    "SENSITIVITY": ("studies.SOBOL_INDICES",),
    # Design of experiments over a shot's parameters
    "SWEEPS": ("studies.SWEEP",),
    # Error budget
    "BUDGETS": ("studies.BUDGET",),
    # Moduli of tests of every kind over their time scales
    "MODULI": ("rates.MODULI",),
    # Slow tests and shots on one axis of time
    "RELAXATIONS": ("material.SLOW_TESTS",),
    # Whole specimens fitted to forces
    "SPECIMENS": ("specimen.SPECIMEN",),
    # Sheet fitted to a displacement field
    "SHEETS": ("specimen.SHEET",),
    # Pressurised actuator
    "ACTUATORS": ("actuator.FIGURES",),
}
"""Files and names of the figures of each registry; a file is loaded when one of its registries is asked
for, since a command shows one page."""

SHOWN_BY: dict[str, str] = {
    "dic.calibration.views.Calibration": "CALIBRATION",
    "dic.chain.remarks.Speckles": "SPECKLES",
    "kolsky.bars.guides.propagation.BarsTogether": "BARS_TOGETHER",
    "kolsky.bars.reduction.repeated_tests.RepeatedTests": "REPEATS",
    "kolsky.bars.records.FlyerResult": "FLYER_TESTS",
    "kolsky.bars.records.WavesResult": "WAVES",
    "kolsky.inverse.result.Identification": "REGISTRY",
    "kolsky.inverse.joint_result.JointResult": "JOINT",
    "kolsky.studies.rate_dependence.SlowDynamics": "RELAXATIONS",
    "kolsky.material.fits.compare.Comparison": "MATERIALS",
    "kolsky.material.reference_curve.ReferenceCurve": "BASELINES",
    "kolsky.report.body_views.ActuatorView": "ACTUATORS",
    "kolsky.report.picture_views.FullFieldView": "FULL_FIELDS",
    "kolsky.report.body_views.SheetView": "SHEETS",
    "kolsky.report.body_views.SpecimenView": "SPECIMENS",
    "kolsky.report.picture_views.SurfaceView": "SURFACES",
    "kolsky.prediction.predict.Prediction": "PREDICTIONS",
    "kolsky.shot.recordings.ShotRecordings": "RECORDINGS",
    "kolsky.shot.bars.CheckedBars": "BAR_CHECKS",
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
