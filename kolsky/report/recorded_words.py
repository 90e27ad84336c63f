"""Words, units and digits of what a result records beside its parameters: settings, checks, its surrogate."""

from kolsky.report.nomenclature import factor_of, name_of

LABELS = {
    "specimen.diameter": "diameter",
    "specimen.length": "length",
    "specimen.density": "density",
    "specimen_length.declared": "length, declared",
    "specimen_length.declared_sigma": "length, declared, standard uncertainty",
    "specimen_length.pictures": "length in the pictures",
    "specimen_length.pictures_sigma": "length in the pictures, standard uncertainty",
    "specimen_length.used": "length, used",
    "specimen_length.used_sigma": "length, used, standard uncertainty",
    "specimen_length.y_shift": "outline’s heights, shifted by",
    "specimen_length.y_sigma": "outline’s heights, standard uncertainty at a known length",
    "specimen_length.y_per_length": "error of the heights over that of the length",
    "interface.faces": "interface, end faces",
    "interface.side": "interface, side surface",
    "declared_interface.faces": "the shot declares, end faces",
    "declared_interface.side": "the shot declares, side surface",
    "support": "transmission side",
    "window_s": "simulated window",
    "flyer_chi2_per_dof": "flyer fit, χ² per degree of freedom",
    "flyer_noise_scale": "flyer noise, used over declared",
    "flyer_static_scatter": "flyer noise, static frames over declared",
    "front_noise_scale": "front face’s velocity, noise used over declared",
    "front_sigma_gain": "front face’s velocity, standard uncertainty of its scale",
    "force_noise_correlation": "force noise, correlation of neighbouring samples",
    "force_baseline_samples": "force noise, samples it is from",
    "window_end": "end of the window",
    "symmetry_end": "end of symmetry by the flyer’s flight",
    "hold": "held at the shot’s value",
    "curve_last_s": "quasi-static curve, last √(Ī₁ − 3)",
    "curve_last_strain": "quasi-static curve, last nominal strain",
    "numerics.mesh": "mesh of the surrogate",
    "numerics.grading": "mesh, largest over smallest element",
    "numerics.safety": "time step over the stable one",
    "numerics.precision": "arithmetic",
    "numerics.device": "device",
    "numerics.threads": "threads",
    "numerics.past_data": "past the quasi-static curve",
    "numerics.element": "element",
    "numerics.hourglass_form": "hourglass control",
    "numerics.compressible": "Poisson’s ratio corrected from",
    "refined_mesh": "refined mesh",
    "replicates": "replicates of the input noise",
    "replicate_mesh": "mesh of the replicates",
    "bayes": "posterior sampled",
    "seed": "seed of random draws",
    "machine": "processor",
    "recordings.force_from": "force from",
    "recordings.channel": "channel of the recorder",
    "recordings.sampling_interval_s": "sampling interval",
    "recordings.baseline_s": "baseline",
    "recordings.baseline_V": "mean of the baseline, subtracted",
    "recordings.noise_V": "noise of a sample, from the baseline",
    "recordings.sensitivity_V_per_N": "sensitivity",
    "recordings.compression": "compression gives",
    "recordings.clock_offset_s": "clock, shot’s minus recorder’s",
    "recordings.frames": "frames with a flyer displacement",
    "recordings.flyer_sigma_m": "noise of a flyer displacement, median",
    "recordings.front_noise_m_per_s": "noise of the front face’s velocity",
    "recordings.front_samples": "samples of the front face’s velocity",
    "recordings.window_start_s": "window, first time",
    "recordings.window_end_s": "window, last time",
    "recordings.symmetry_end_s": "end of symmetry by the flyer’s flight",
}
"""Words for the dotted keys of provenance; other keys are shown unchanged."""

UNITS = {
    "specimen.diameter": (1e3, "mm"),
    "specimen.length": (1e3, "mm"),
    "specimen.density": (1.0, "kg/m³"),
    "specimen_length.declared": (1e3, "mm"),
    "specimen_length.declared_sigma": (1e6, "µm"),
    "specimen_length.pictures": (1e3, "mm"),
    "specimen_length.pictures_sigma": (1e6, "µm"),
    "specimen_length.used": (1e3, "mm"),
    "specimen_length.used_sigma": (1e6, "µm"),
    "specimen_length.y_shift": (1e6, "µm"),
    "specimen_length.y_sigma": (1e6, "µm"),
    "window_s": (1e3, "ms"),
    "window_end": (1e3, "ms"),
    "symmetry_end": (1e3, "ms"),
    "recordings.sampling_interval_s": (1e6, "µs"),
    "recordings.baseline_s": (1e3, "ms"),
    "recordings.baseline_V": (1e3, "mV"),
    "recordings.noise_V": (1e3, "mV"),
    "recordings.sensitivity_V_per_N": (1e3, "mV/N"),
    "recordings.clock_offset_s": (1e6, "µs"),
    "recordings.flyer_sigma_m": (1e6, "µm"),
    "recordings.front_noise_m_per_s": (1.0, "m/s"),
    "recordings.window_start_s": (1e3, "ms"),
    "recordings.window_end_s": (1e3, "ms"),
    "recordings.symmetry_end_s": (1e3, "ms"),
}
"""Factor and unit in which an SI entry of provenance is shown."""

JOINED = {
    "window_s": " to ",
    "recordings.baseline_s": " to ",
    "numerics.mesh": " × ",
    "refined_mesh": " × ",
    "replicate_mesh": " × ",
}
"""Separator of the numbers of a list; a comma otherwise."""

DEFAULTS = {"numerics.threads": "all cores", "numerics.compressible": "none, run directly"}
"""Text for a value of None."""

DIGITS = {
    "window_s": 4,
    "window_end": 4,
    "symmetry_end": 4,
    "specimen_length.declared_sigma": 2,
    "specimen_length.pictures": 5,
    "specimen_length.pictures_sigma": 2,
    "specimen_length.used": 5,
    "specimen_length.used_sigma": 2,
    "specimen_length.y_shift": 2,
    "specimen_length.y_sigma": 2,
    "specimen_length.y_per_length": 2,
    "flyer_chi2_per_dof": 3,
    "flyer_noise_scale": 3,
    "flyer_static_scatter": 2,
    "front_noise_scale": 3,
    "front_sigma_gain": 2,
    "force_noise_correlation": 2,
    "curve_last_s": 3,
    "curve_last_strain": 3,
    "recordings.baseline_V": 3,
    "recordings.noise_V": 3,
    "recordings.flyer_sigma_m": 3,
    "recordings.window_start_s": 4,
    "recordings.window_end_s": 4,
}
"""Significant digits of a number; six otherwise."""

QUALITY = {
    "loo_force": ("force, leave-one-out, rms", 1.0, " N"),
    "loo_shape": ("outline, leave-one-out, rms", 1e6, " µm"),
    "check_shift_sigmas": ("optimum moved by the last check run", 1.0, " σ"),
    "check_force": ("force, against the last check run, rms", 1.0, " N"),
    "check_shape": ("outline, against the last check run, rms", 1e6, " µm"),
    "runs_needed": ("runs around the optimum that would do", 1.0, ""),
    "lost_mesh_runs": ("runs lost that were to tell the mesh’s error", 1.0, ""),
    "counted_points": ("outline points counted in the search", 1.0, ""),
    "force_discrepancy": ("discrepancy of the model, force", 1.0, " N"),
    "shape_discrepancy": ("discrepancy of the model, outline", 1e6, " µm"),
    "slow_discrepancy": ("common to many points of the outline", 1e6, " µm"),
    "branch_probability": ("planted elastic data that a weak branch improves as much", 1.0, ""),
    "branch_strength": ("strength of the branch that was searched for", 1.0, ""),
    "branch_time": ("its relaxation time", 1e6, "µs"),
    "branch_share": ("share of what is left that it explains", 1.0, ""),
    "branch_aic": ("Akaike’s criterion with it, less that without", 1.0, ""),
    "valley_margin": ("next valley of Poisson’s ratio, −2 ln L above this one", 1.0, ""),
    "front_moved": ("front face’s path moved by, over its noise, rms", 1.0, ""),
}
"""Words, factor and unit of the entries of `Identification.surrogate`."""


def label(key: str) -> str:
    """Return the words for a dotted key; "free.damping" and "held.damping" name the parameter."""
    kind, dot, name = key.partition(".")
    if dot and kind in ("free", "held"):
        known = name_of(name)
        return f"{kind}: {known.words.split(',')[0]}" + (f" {known.symbol}" if known.symbol != name else "")
    return LABELS.get(key, key)


def written(key: str) -> tuple[float, str, str, str, int]:
    """Return how a value is shown: factor, unit, separator of a list, text for None, significant digits."""
    factor, unit = UNITS.get(key, (1.0, ""))
    kind, dot, name = key.partition(".")
    if dot and kind in ("free", "held"):
        unit = "" if name_of(name).unit in ("1", "SI") else name_of(name).unit
        return factor_of(name), unit, " to ", "default bounds", 6
    return factor, unit, JOINED.get(key, ", "), DEFAULTS.get(key, "default"), DIGITS.get(key, 6)
