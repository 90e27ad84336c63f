"""A specification from a shot: the same test in the virtual laboratory, as far as its files tell."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import nnls

from kolsky.base.errors import InputError
from kolsky.base.files import write_table
from kolsky.base.records import FlyerMotion, MaterialCurve
from kolsky.shot.records import ForceChannel, Shot
from kolsky.virtual.shot_file import toml_text

MOTION = "motion.csv"
"""The flyer's path of the shot, beside the specification."""
KNOT = 2e-6
"""Distance of its samples [s]."""
DECLARED = {
    "specimen_length": "imperfections.length",
    "specimen_diameter": "imperfections.diameter",
    "specimen_density": "imperfections.density",
    "sensitivity": "imperfections.sensitivity",
    "curve_scale": "imperfections.curve",
    "poisson": "imperfections.poisson",
    "damping": "imperfections.damping",
    "clock_offset": "imperfections.trigger",
    "y_offset": "imperfections.y_offset",
    "Z_offset": "imperfections.Z_offset",
}
"""Key of a shot's [uncertainty] -> key of a specification."""
UNITS = {"damping": "s", "clock_offset": "s", "y_offset": "m", "Z_offset": "m"}
PLAIN = ("poisson",)


def specification_of(shot: Shot, folder: Path, *, answer: Mapping[str, float]) -> Path:
    """Write the specification of a shot, and its flyer's path; returns the specification's file.

    Parameters
    ----------
    shot
        A loaded shot with a flyer, an outline and a force channel.
    folder
        Where to.
    answer
        Parameters identified, by name; what it lacks is as the shot file has it, the stiffness factor 1.

    Raises
    ------
    InputError
        If the shot is of another kind.
    """
    flyer, force, line = shot.flyer, shot.force, shot.centre_line
    if not isinstance(flyer, FlyerMotion) or not isinstance(force, ForceChannel) or line is None:
        raise InputError(
            shot.folder, "has no flyer, outline and force channel", cure="give a specification instead"
        )
    path = shot.flyer_path
    start = max(path.start, shot.window[0])
    times = np.linspace(start, path.end, int(np.ceil((path.end - start) / KNOT)) + 1)
    moved = path.position(times)
    write_table(folder / MOTION, {"time (s)": times, "displacement (m)": moved - moved[0]})
    static = int((flyer.time <= start + 1e-9).sum())
    parameters, modulus = yeoh_of(shot.curve)
    heights = line.y[line.frame == line.frame[0]] / shot.specimen.length
    rate = 1.0 / float(np.median(np.diff(flyer.time)))
    volts = force.baseline_volts()
    bar = shot.transmission_bar
    tables: dict[str, dict[str, Any]] = {
        "specimen": {
            "diameter": f"{shot.specimen.diameter:.9g} m",
            "length": f"{shot.specimen.length:.9g} m",
            "density": f"{shot.specimen.density:.9g} kg/m^3",
        },
        "material": {
            "law": "yeoh",
            "parameters": parameters,
            "shear_modulus": f"{modulus:.9g} Pa",
            "stiffness_factor": float(answer.get("stiffness_factor", 1.0)),
            "poisson": float(answer.get("poisson", shot.model.poisson)),
            "damping": f"{answer.get('damping', shot.model.damping):.9g} s",
            "mass_damping": f"{shot.model.mass_damping:.9g} 1/s",
        },
        "quasi_static": {"largest_strain": f"{100.0 * (1.0 - shot.curve.stretch.min()):.9g} %"},
        "interface": {
            "faces": shot.interface.faces,
            "side": shot.interface.side,
            "friction": shot.interface.friction,
        },
        "transmission": {"support": "rigid" if bar is None else "bar"},
        "motion": {
            "kind": "sampled",
            "file": MOTION,
            "start": f"{start:.9g} s",
            "compression": "75 %",
        },
        "scope": {
            "interval": f"{float(np.median(np.diff(force.time))):.9g} s",
            "start": f"{force.time[0]:.9g} s",
            "full_scale": f"{force.transducer.full_scale:.9g} V",
        },
        "transmitted": {
            "sensitivity": f"{force.transducer.sensitivity:.9g} V/N",
            "baseline": f"{volts.mean():.9g} V",
            "noise": f"{volts.std(ddof=1):.9g} V",
        },
        "frames": {"rate": f"{rate:.9g} Hz", "static": max(static, 3)},
        "exports": {
            "flyer_sigma": f"{float(np.median(flyer.sigma)):.9g} m",
            "outline_sigma": f"{float(np.median(line.sigma)):.9g} m",
            "points": max(4, round(line.y.size / len(np.unique(line.frame)))),
            "lowest": f"{100.0 * min(max(heights.min(), 0.02), 0.4):.9g} %",
            "highest": f"{100.0 * max(min(heights.max(), 0.98), 0.6):.9g} %",
        },
    }
    if bar is not None:
        tables["transmission.bar"] = {
            "diameter": f"{bar.diameter:.9g} m",
            "length": f"{bar.length:.9g} m",
            "youngs_modulus": f"{bar.youngs_modulus:.9g} Pa",
            "density": f"{bar.density:.9g} kg/m^3",
            "poisson": bar.poisson,
        }
    sizes = declared_sizes(shot.uncertainty)
    if sizes:
        tables["budget"] = {json.dumps(key): size for key, size in sizes.items()}
    made = folder / "SPEC.toml"
    text = toml_text(tables, name=shot.name, head=f"# The test of {shot.name} in the virtual laboratory.\n")
    made.write_text(text, encoding="utf-8")
    return made


def declared_sizes(uncertainty: Mapping[str, float]) -> dict[str, str | float]:
    """A shot's declared standard uncertainties as keys and sizes of a budget; those of 0 are left out."""
    return {
        DECLARED[key]: sigma if key in PLAIN else f"{sigma:.9g} {UNITS.get(key, '')}".strip()
        for key, sigma in uncertainty.items()
        if key in DECLARED and sigma > 0.0
    }


def yeoh_of(curve: MaterialCurve) -> tuple[dict[str, float], float]:
    """Yeoh's law through a curve: constants over the shear modulus, and the shear modulus [Pa].

    Non-negative least squares in the stress, weighed by its sigma; the law is linear in its constants.
    """
    lam = curve.stretch
    x = lam**2 + 2.0 / lam - 3.0
    basis = 2.0 * (lam - lam**-2)[:, None] * np.stack([np.ones_like(x), 2.0 * x, 3.0 * x**2], axis=1)
    sigma = np.maximum(curve.total_sigma, 1e-3 * np.abs(curve.stress).max())
    constants, _ = nnls(basis / sigma[:, None], curve.stress / sigma)
    modulus = 2.0 * float(constants[0])
    if not modulus > 0.0:
        raise ValueError("the curve has no stiffness at rest that Yeoh's law could take")
    names = ("C10", "C20", "C30")
    return {name: float(c / constants[0]) for name, c in zip(names, constants, strict=True)}, modulus
