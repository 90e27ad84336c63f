"""Display of an identification: display units (damping in microseconds), words and digits of its records."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from kolsky.inverse.result import Estimate, Identification
from kolsky.results.hdf5 import ESTIMATE, IDENTIFICATION
from kolsky.results.nomenclature import factor_of, name_of


def in_display_units(result: Identification) -> Identification:
    """Return a result with every parameter in the unit of `kolsky.results.nomenclature`.

    For pages and figures. Files and JSON stay in SI. Apply it once, because its result is not in SI units.
    """
    factors = np.array([factor_of(name) for name in result.design.names])
    shown = IDENTIFICATION.scaled(result, factor_of)
    return replace(
        shown,
        estimates={name: _with_unit(e) for name, e in shown.estimates.items()},
        profiles=tuple(replace(one, points=one.points * factors) for one in shown.profiles),
    )


def estimate_in_display_units(e: Estimate) -> Estimate:
    """Return one estimate in its display unit."""
    return _with_unit(ESTIMATE.scaled(e, factor_of))


def _with_unit(e: Estimate) -> Estimate:
    return replace(e, unit=name_of(e.name, e.unit).unit)


class Recorded(NamedTuple):
    """Display format of an entry of provenance."""

    words: str = ""
    """Its words; its key if empty."""
    factor: float = 1.0
    """Displayed number divided by the number in SI."""
    unit: str = ""
    """Unit of the shown number."""
    digits: int = 6
    """Significant digits of a number."""
    between: str = ", "
    """Separator of the numbers of a list."""
    nothing: str = "default"
    """Text for a value of None."""


RECORDED = {
    "specimen.diameter": Recorded("diameter", 1e3, "mm"),
    "specimen.length": Recorded("length", 1e3, "mm"),
    "specimen.density": Recorded("density", 1.0, "kg/m³"),
    "specimen_length.declared": Recorded("length, declared", 1e3, "mm"),
    "specimen_length.declared_sigma": Recorded("length, declared, standard uncertainty", 1e6, "µm", digits=2),
    "specimen_length.pictures": Recorded("length in the pictures", 1e3, "mm", digits=5),
    "specimen_length.pictures_sigma": Recorded(
        "length in the pictures, standard uncertainty", 1e6, "µm", digits=2
    ),
    "specimen_length.used": Recorded("length, used", 1e3, "mm", digits=5),
    "specimen_length.used_sigma": Recorded("length, used, standard uncertainty", 1e6, "µm", digits=2),
    "specimen_length.y_shift": Recorded("outline’s heights, shifted by", 1e6, "µm", digits=2),
    "specimen_length.y_sigma": Recorded(
        "outline’s heights, standard uncertainty at a known length", 1e6, "µm", digits=2
    ),
    "specimen_length.y_per_length": Recorded("error of the heights over that of the length", digits=2),
    "interface.faces": Recorded("interface, end faces"),
    "interface.side": Recorded("interface, side surface"),
    "declared_interface.faces": Recorded("the shot declares, end faces"),
    "declared_interface.side": Recorded("the shot declares, side surface"),
    "support": Recorded("transmission side"),
    "window_s": Recorded("simulated window", 1e3, "ms", digits=4, between=" to "),
    "flyer_chi2_per_dof": Recorded("flyer fit, χ² per degree of freedom", digits=3),
    "flyer_noise_scale": Recorded("flyer noise, used over declared", digits=3),
    "flyer_static_scatter": Recorded("flyer noise, static frames over declared", digits=2),
    "front_noise_scale": Recorded("front face’s velocity, noise used over declared", digits=3),
    "front_sigma_gain": Recorded("front face’s velocity, standard uncertainty of its scale", digits=2),
    "force_noise_correlation": Recorded("force noise, correlation of neighbouring samples", digits=2),
    "force_baseline_samples": Recorded("force noise, samples it is from"),
    "window_end": Recorded("end of the window", 1e3, "ms", digits=4),
    "symmetry_end": Recorded("end of symmetry by the flyer’s flight", 1e3, "ms", digits=4),
    "hold": Recorded("held at the shot’s value"),
    "curve_last_s": Recorded("quasi-static curve, last √(Ī₁ − 3)", digits=3),
    "curve_last_strain": Recorded("quasi-static curve, last nominal strain", digits=3),
    "numerics.mesh": Recorded("mesh of the surrogate", between=" × "),
    "numerics.grading": Recorded("mesh of the surrogate, largest over smallest element"),
    "numerics.safety": Recorded("time step over the stable one"),
    "numerics.precision": Recorded("arithmetic", nothing="fp64; a search uses fp32 first"),
    "numerics.device": Recorded("device"),
    "numerics.threads": Recorded("threads", nothing="all cores"),
    "numerics.past_data": Recorded("past the quasi-static curve"),
    "numerics.element": Recorded("element"),
    "numerics.hourglass_form": Recorded("hourglass control"),
    "numerics.compressible": Recorded("Poisson’s ratio corrected from", nothing="none, run directly"),
    "refined_mesh": Recorded("refined mesh", between=" × "),
    "refined_grading": Recorded("refined mesh, largest over smallest element"),
    "replicates": Recorded("replicates of the input noise"),
    "replicate_mesh": Recorded("mesh of the replicates", between=" × "),
    "bayes": Recorded("posterior sampled"),
    "seed": Recorded("seed of random draws"),
    "machine": Recorded("processor"),
    "recordings.force_from": Recorded("force from"),
    "recordings.channel": Recorded("channel of the recorder"),
    "recordings.sampling_interval_s": Recorded("sampling interval", 1e6, "µs"),
    "recordings.baseline_s": Recorded("baseline", 1e3, "ms", between=" to "),
    "recordings.baseline_V": Recorded("mean of the baseline, subtracted", 1e3, "mV", digits=3),
    "recordings.noise_V": Recorded("noise of a sample, from the baseline", 1e3, "mV", digits=3),
    "recordings.sensitivity_V_per_N": Recorded("sensitivity", 1e3, "mV/N"),
    "recordings.compression": Recorded("compression gives"),
    "recordings.clock_offset_s": Recorded("clock, shot’s minus recorder’s", 1e6, "µs"),
    "recordings.frames": Recorded("frames with a flyer displacement"),
    "recordings.flyer_sigma_m": Recorded("noise of a flyer displacement, median", 1e6, "µm", digits=3),
    "recordings.front_noise_m_per_s": Recorded("noise of the front face’s velocity", 1.0, "m/s"),
    "recordings.front_samples": Recorded("samples of the front face’s velocity"),
    "recordings.window_start_s": Recorded("window, first time", 1e3, "ms", digits=4),
    "recordings.window_end_s": Recorded("window, last time", 1e3, "ms", digits=4),
    "recordings.symmetry_end_s": Recorded("end of symmetry by the flyer’s flight", 1e3, "ms"),
}
"""Entries of provenance by their dotted key."""

QUALITY = {
    "loo_force": ("force, leave-one-out, rms", 1.0, " N"),
    "loo_shape": ("outline, leave-one-out, rms", 1e6, " µm"),
    "check_shift_sigmas": ("optimum moved by the last check run", 1.0, " σ"),
    "check_force": ("force, against the last check run, rms", 1.0, " N"),
    "check_shape": ("outline, against the last check run, rms", 1e6, " µm"),
    "lost_mesh_runs": ("failed runs for the mesh’s error", 1.0, ""),
    "counted_points": ("outline points counted in the search", 1.0, ""),
    "force_discrepancy": ("discrepancy of the model, force", 1.0, " N"),
    "shape_discrepancy": ("discrepancy of the model, outline", 1e6, " µm"),
    "slow_discrepancy": ("common to many points of the outline", 1e6, " µm"),
    "branch_probability": ("planted elastic data that a weak branch improves as much", 1.0, ""),
    "branch_strength": ("strength of the branch that was searched for", 1.0, ""),
    "branch_time": ("its relaxation time", 1e6, "µs"),
    "branch_share": ("share of the remaining misfit that it explains", 1.0, ""),
    "branch_aic": ("Akaike’s criterion with it minus that without", 1.0, ""),
    "valley_margin": ("next valley of Poisson’s ratio, −2 ln L above this one", 1.0, ""),
    "limit_rise": ("incompressible limit, −2 ln L above this one", 1.0, ""),
    "front_moved": ("front face’s path moved by, over its noise, rms", 1.0, ""),
}
"""Words, factor and unit of the entries of `Identification.surrogate`."""


def recorded_label(key: str) -> str:
    """Return the words for a dotted key; "free.damping" and "held.damping" name the parameter."""
    kind, dot, name = key.partition(".")
    if dot and kind in ("free", "held"):
        known = name_of(name)
        return f"{kind}: {known.words.split(',')[0]}" + (f" {known.symbol}" if known.symbol != name else "")
    return RECORDED.get(key, Recorded()).words or key


def recorded_value(key: str) -> tuple[float, str, str, str, int]:
    """Return the display of a value. Factor, unit, separator of a list, text for None, significant digits."""
    kind, dot, name = key.partition(".")
    if dot and kind in ("free", "held"):
        unit = "" if name_of(name).unit in ("1", "SI") else name_of(name).unit
        return factor_of(name), unit, " to ", "default bounds", 6
    shown = RECORDED.get(key, Recorded())
    return shown.factor, shown.unit, shown.between, shown.nothing, shown.digits
