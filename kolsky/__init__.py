"""Identify the dynamic stiffness of a soft material, with its uncertainty, from one impact test.

The public names for scripts are available here: ``import kolsky``, then ``kolsky.load_shot``,
``kolsky.identify`` and so on. Each name is loaded when it is first used. `docs/architecture.md` describes the
packages behind them.
"""

from typing import TYPE_CHECKING, Any

from kolsky.base.shadows import warn_of_shadows as _warn_of_shadows
from kolsky.report.ipython import register as _register_views

if TYPE_CHECKING:
    from kolsky.bars.flyer.path import fit_flyer
    from kolsky.base.errors import InputError
    from kolsky.base.files import write_table
    from kolsky.base.records import FlyerMotion
    from kolsky.identification import diagnose, identify
    from kolsky.inverse.forward import Forward, material_law
    from kolsky.inverse.observations import radius_at
    from kolsky.inverse.result import Identification
    from kolsky.inverse.settings import JointSettings, Numerics, Settings
    from kolsky.inverse.simulate import simulate, write_simulation
    from kolsky.inverse.slow_tests import read_slow_tests
    from kolsky.joint_identification import identify_shots
    from kolsky.material.end_friction.problem import EndFriction
    from kolsky.material.fits.compare import compare_laws
    from kolsky.material.fits.fit import fit_law
    from kolsky.material.fits.homogeneous_test import HomogeneousTest, read_homogeneous_test
    from kolsky.material.reference_curve import Treatment, read_uniaxial_test, reference_curve
    from kolsky.material.slow_compression import slow_compression
    from kolsky.material.uniaxial import UniaxialTest
    from kolsky.prediction.predict import predict, read_test
    from kolsky.report.canvas import save_figures
    from kolsky.report.figures import figures_of
    from kolsky.report.notebook import to_dataframe
    from kolsky.report.pages.identification import write_report
    from kolsky.report.result_folder import (
        read_identify_results,
        tables_of,
        write_dic_results,
        write_identify_results,
        write_results,
        write_sweep_results,
    )
    from kolsky.results.hdf5 import read_identification, write_identification
    from kolsky.shot.dic import dic
    from kolsky.shot.load import check_shot, load_pictures, load_shot
    from kolsky.shot.optical_data import measured
    from kolsky.shot.records import Shot
    from kolsky.shot.waves import repeats, waves
    from kolsky.studies.paper_method import paper_method
    from kolsky.studies.planning.plan import plan
    from kolsky.studies.rates.rate import rate
    from kolsky.studies.sweep import sweep
    from kolsky.studies.sweep_analysis import analyse_sweep

_HOME = {
    "EndFriction": "kolsky.material.end_friction.problem",
    "FlyerMotion": "kolsky.base.records",
    "Forward": "kolsky.inverse.forward",
    "HomogeneousTest": "kolsky.material.fits.homogeneous_test",
    "Identification": "kolsky.inverse.result",
    "InputError": "kolsky.base.errors",
    "JointSettings": "kolsky.inverse.settings",
    "Numerics": "kolsky.inverse.settings",
    "Settings": "kolsky.inverse.settings",
    "Shot": "kolsky.shot.records",
    "Treatment": "kolsky.material.reference_curve",
    "UniaxialTest": "kolsky.material.uniaxial",
    "analyse_sweep": "kolsky.studies.sweep_analysis",
    "check_shot": "kolsky.shot.load",
    "compare_laws": "kolsky.material.fits.compare",
    "diagnose": "kolsky.identification",
    "dic": "kolsky.shot.dic",
    "figures_of": "kolsky.report.figures",
    "fit_flyer": "kolsky.bars.flyer.path",
    "fit_law": "kolsky.material.fits.fit",
    "identify": "kolsky.identification",
    "identify_shots": "kolsky.joint_identification",
    "load_pictures": "kolsky.shot.load",
    "load_shot": "kolsky.shot.load",
    "material_law": "kolsky.inverse.forward",
    "paper_method": "kolsky.studies.paper_method",
    "plan": "kolsky.studies.planning.plan",
    "predict": "kolsky.prediction.predict",
    "measured": "kolsky.shot.optical_data",
    "radius_at": "kolsky.inverse.observations",
    "rate": "kolsky.studies.rates.rate",
    "read_homogeneous_test": "kolsky.material.fits.homogeneous_test",
    "read_identification": "kolsky.results.hdf5",
    "read_identify_results": "kolsky.report.result_folder",
    "read_test": "kolsky.prediction.predict",
    "read_uniaxial_test": "kolsky.material.reference_curve",
    "read_slow_tests": "kolsky.inverse.slow_tests",
    "reference_curve": "kolsky.material.reference_curve",
    "repeats": "kolsky.shot.waves",
    "save_figures": "kolsky.report.canvas",
    "simulate": "kolsky.inverse.simulate",
    "slow_compression": "kolsky.material.slow_compression",
    "sweep": "kolsky.studies.sweep",
    "tables_of": "kolsky.report.result_folder",
    "to_dataframe": "kolsky.report.notebook",
    "waves": "kolsky.shot.waves",
    "write_dic_results": "kolsky.report.result_folder",
    "write_identification": "kolsky.results.hdf5",
    "write_identify_results": "kolsky.report.result_folder",
    "write_report": "kolsky.report.pages.identification",
    "write_simulation": "kolsky.inverse.simulate",
    "write_results": "kolsky.report.result_folder",
    "write_sweep_results": "kolsky.report.result_folder",
    "write_table": "kolsky.base.files",
}
"""Module of each public name. The imports above list the same names for type checkers; a test compares the
two lists."""

__all__ = [*_HOME]


def __getattr__(name: str) -> Any:
    """Load a public name at its first use."""
    if name not in _HOME:
        raise AttributeError(f"module 'kolsky' has no attribute {name!r}; it offers {', '.join(_HOME)}")
    from importlib import import_module

    value = getattr(import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOME})


_warn_of_shadows()
_register_views()
