"""Nomenclature of pages and figures: symbols, units and words of parameters and of recorded settings."""

import re
from collections.abc import Iterable
from dataclasses import dataclass

from kolsky.inverse.parameters import PARAMETERS


@dataclass(frozen=True)
class Name:
    """Symbol, words and display unit of a parameter."""

    symbol: str
    """Symbol in plain text, e.g. "m"."""
    tex: str
    """Symbol for figures (mathtext without dollar signs)."""
    words: str
    """Words, e.g. "stiffness factor"."""
    unit: str
    """Unit in which it is shown, "1" if none."""
    factor: float = 1.0
    """Shown number over SI number."""


_NAMES = {
    "force_discrepancy": Name("τ_F", r"\tau_F", "discrepancy of the force", "N"),
    "shape_discrepancy": Name("τ_Z", r"\tau_Z", "discrepancy of the outline", "µm", 1e6),
}


def _known(parameter: str) -> Name | None:
    if parameter in PARAMETERS:
        p = PARAMETERS[parameter]
        return Name(p.written, p.tex, p.words, p.shown_unit, p.shown_factor)
    return _NAMES.get(parameter)


NOISE = {"force and shape": "force and outline"}
"""Words for the sources of noise whose keys are older than the words."""

_ROUTES = {
    "joint": "joint χ²",
    "force only": "force χ² only",
    "shape only": "outline χ² only",
    "paper": "cost Φ, Eq. (M.5)",
}


def name_of(parameter: str, unit: str | None = None) -> Name:
    """Return how a parameter is written; an unknown one is written by its key."""
    known = _known(parameter)
    if known is not None:
        return known
    words = parameter.replace("_", " ")
    escaped = words.replace("\\", " ").replace("$", " ").replace("^", " ").replace(" ", r"\ ")
    return Name(words, rf"\mathrm{{{escaped}}}", words, unit or "SI")


def short(parameter: str) -> str:
    """Return a parameter for use in a sentence: first words and symbol, e.g. "stiffness factor m"."""
    name = name_of(parameter)
    words = re.split(r",| between| of the initial| at which", name.words)[0]
    return words if name.symbol == words else f"{words} {name.symbol}"


def in_words(text: str, names: Iterable[str] = ()) -> str:
    """Return a sentence in which every API name of a parameter is replaced by `short`.

    Parameters
    ----------
    text
        The sentence.
    names
        Parameters to replace, beside those whose API name is no English word; "friction" may be the plain
        word.
    """
    known = {*names, *(name for name in (*PARAMETERS, *_NAMES) if "_" in name)}
    called = "|".join(sorted(map(re.escape, known), key=len, reverse=True))
    return re.sub(rf"(?<![\w.\-\[])({called})(?![\w\]])", lambda found: short(found[1]), text)


def constant_symbol(name: str) -> str:
    """Return a constant of a law for figures: "poisson" is ν, C10 has its number as an index.

    A name that is no letter with a number stands upright.
    """
    greek = {"poisson": r"\nu", "mu": r"\mu", "alpha": r"\alpha", "lam": r"\lambda"}
    parts = re.fullmatch(r"(poisson|alpha|lam|mu|[A-Za-z])_?(\d*)", name)
    if parts is None:
        return f"${name_of(name).tex}$"
    index = rf"_{{{parts[2]}}}" if parts[2] else ""
    return f"${greek.get(parts[1], parts[1])}{index}$"


def factor_of(parameter: str) -> float:
    """Return the displayed number over the SI number."""
    known = _known(parameter)
    return 1.0 if known is None else known.factor


def axis_label(parameter: str, unit: str | None = None) -> str:
    """Return the axis label of a parameter: words, symbol and unit in brackets."""
    name = name_of(parameter, unit)
    words = name.words.split(",")[0].split(" between")[0]
    unit = "–" if name.unit == "1" else name.unit
    if name.symbol == words:
        return f"{words.capitalize()} ({unit})"
    return f"{words[0].upper()}{words[1:]} ${name.tex}$ ({unit})"


def route_label(route: str) -> str:
    """Return the objective of a route of `Identification.routes` in words."""
    return _ROUTES.get(route, route)


STAGES = {
    "compile": "compiling, once on this machine",
    "design": "design",
    "refinement": "design near the optimum",
    "check": "check on the refined mesh",
    "noise": "replicates of the input noise",
    "profile": "profile likelihoods",
    "posterior": "posterior",
    "choices": "other choices",
    "systematic": "declared uncertainties",
    "inputs": "effect of the inputs",
    "causes": "inputs that may be wrong",
    "simulation": "simulation",
    "sweep": "sweep",
    "rates": "speeds of the flyer",
    "calibration": "calibration pictures",
    "specimen, camera 0": "specimen in camera 0",
    "specimen, camera 1": "specimen in camera 1",
    "flyer, camera 0": "flyer in camera 0",
    "flyer, camera 1": "flyer in camera 1",
    "waves": "waves",
    "repeats": "tests",
    "rate": "shots",
}
"""Stages of the work."""

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
