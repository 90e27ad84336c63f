"""shot.toml of a synthetic shot from its specification.

A specification can also be made from a real shot's shot.toml.

The declared values are the true ones, except for [imperfections].
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import nnls

from kolsky.base.apparatus import LARGEST_POISSON
from kolsky.base.errors import InputError
from kolsky.base.files import write_table
from kolsky.base.records import FlyerMotion, MaterialCurve
from kolsky.schema.material import RelaxationSection
from kolsky.shot.inputs import INPUTS
from kolsky.shot.records import ForceChannel, Shot
from kolsky.virtual.instruments import FORMATS
from kolsky.virtual.schema import ChannelTable, Specification
from kolsky.virtual.truth import SurfaceHistory

HEAD = "# Made by kolsky virtual make; its answer is in truth.json, which no other command reads.\n"
QUIET = 5e-6
"""Time from the end of the baseline to the last static frame [s]."""
_NO_DROOP = 1e6
"""A time constant that is much longer than any test [s]."""
SMALLEST_BASELINE = 20
"""Smallest number of baseline samples needed for its zero and noise."""

Tables = Mapping[str, Mapping[str, Any]]


def shot_tables(quantities: Specification, surface: SurfaceHistory) -> dict[str, dict[str, Any]]:
    """The tables of shot.toml as TOML values. Quantities are texts with units."""
    q, wrong = quantities, quantities.imperfections
    form = FORMATS[q.scope.format]
    incident, transmitted = form.columns
    poisson = q.material.poisson + wrong.poisson
    damping = q.material.damping + wrong.damping
    if not 0.0 <= poisson <= LARGEST_POISSON or damping < 0.0:
        raise ValueError(
            f"declared poisson = {poisson:g} and damping = {damping:g} s are not allowed; they must be in "
            f"[0, {LARGEST_POISSON}] and >= 0 s: change [imperfections]"
        )
    last_static = float(surface.time[q.frames.static - 1]) + wrong.trigger
    quiet = min(0.0, last_static, float(surface.time[q.frames.static - 1]) - QUIET)
    if quiet - q.scope.start < SMALLEST_BASELINE * q.scope.interval:
        raise ValueError(
            f"scope.start = {q.scope.start * 1e6:g} us leaves no baseline before {quiet * 1e6:g} us: start "
            "the recorder earlier"
        )
    tables: dict[str, dict[str, Any]] = {
        "specimen": {
            "diameter": _mm(q.specimen.diameter * (1.0 + wrong.diameter)),
            "length": _mm(q.specimen.length * (1.0 + wrong.length)),
            "density": f"{q.specimen.density * (1.0 + wrong.density):.9g} kg/m^3",
        },
        "interface": _interface(q),
        "transmission": {"support": q.transmission.support},
        **_bar(q),
        "force": {
            "file": form.name,
            **form.force,
            "voltage": {"column": transmitted, "unit": "V"},
            "sensitivity": f"{q.transmitted.sensitivity * (1.0 + wrong.sensitivity):.9g} V/N",
            **_channel(q.transmitted),
            "full_scale": f"{q.scope.full_scale:.9g} V",
            "bits": q.scope.bits,
            "baseline": [_us(q.scope.start), _us(quiet)],
            "clock_offset": _us(q.scope.clock_offset),
        },
        "incident_force": {
            "voltage": {"column": incident, "unit": "V"},
            "sensitivity": f"{q.incident.sensitivity:.9g} V/N",
            **_channel(q.incident),
            **_no_droop(q),
            "mass": f"{q.incident.platen_mass * 1e3:.9g} g",
        },
        "frames": {
            "file": "frames.csv",
            "frame": "frame",
            "time": {"column": "time (s)", "unit": "s"},
            "static": q.frames.static,
            "clock_offset": _us(q.frames.clock_offset),
        },
        **(_exports(q) if q.exports.write else {}),
        "curve": {
            "file": "quasi_static.csv",
            "strain": {"column": "nominal strain (-)", "unit": "1"},
            "stress": {"column": "nominal stress (Pa)", "unit": "Pa"},
            "convention": "tension positive",
            "branch": "compression",
            "relative_sigma": f"{q.quasi_static.sigma * 100.0:.9g} %",
            **({} if q.quasi_static.sigma > 0.0 else {"sigma_floor": "1 Pa"}),
        },
        "model": {
            "poisson": float(f"{poisson:.9g}"),
            "damping": _us(damping),
            "damping_kind": "deviatoric",
            "mass_damping": f"{q.material.mass_damping:.9g} 1/s",
        },
    }
    if q.relaxation is not None:
        tables["relaxation"] = relaxation_table(q.relaxation)
    if q.uncertainty is not None:
        tables["uncertainty"] = _uncertainty(q.uncertainty.model_dump(exclude_unset=True))
    return tables


def toml_text(tables: Tables, *, name: str, head: str = HEAD) -> str:
    """The tables as a TOML file."""
    parts = [head, f"format = 1\nname = {_value(name)}\n"]
    for title, table in tables.items():
        lines = "".join(f"{key} = {_value(value)}\n" for key, value in table.items())
        parts.append(f"[{title}]\n{lines}")
    return "\n".join(parts)


def relaxation_table(declared: RelaxationSection) -> dict[str, Any]:
    """[relaxation] as written, every quantity in its SI unit."""
    units = {"times": "s", "sigma_times": "s", "resistance": "Pa", "sigma_resistance": "Pa"}
    given = declared.model_dump(exclude_unset=True, exclude_none=True)
    return {key: _quantity(value, units[key]) if key in units else value for key, value in given.items()}


def _quantity(value: Any, unit: str) -> Any:
    """A number, or each of several, with its unit as text."""
    if isinstance(value, tuple):
        return [_quantity(one, unit) for one in value]
    return f"{value:.9g} {unit}".strip()


def _exports(q: Specification) -> dict[str, dict[str, Any]]:
    return {
        "flyer": {
            "file": "flyer.csv",
            "frame": "frame",
            "time": {"column": "time (s)", "unit": "s"},
            "displacement": {"column": "flyer displacement toward the specimen (mm)", "unit": "mm"},
            "positive": "toward specimen",
            "sigma": f"{q.exports.flyer_sigma * 1e6:.9g} um",
        },
        "centre_line": {
            "file": "centreline.csv",
            "frame": "frame",
            "time": {"column": "time (s)", "unit": "s"},
            "y": {"column": "y (mm)", "unit": "mm"},
            "Z": {"column": "Z (mm)", "unit": "mm"},
            "y_offset": "0 mm",
            "Z_offset": "0 mm",
            "sigma": f"{q.exports.outline_sigma * 1e6:.9g} um",
        },
    }


def _interface(q: Specification) -> dict[str, Any]:
    from kolsky.schema.apparatus import keys_read

    declared = q.interface
    read = keys_read(declared.faces, declared.side)
    if extra := [key for key in read if key != "friction"]:
        raise ValueError(f"interface: a law that reads {extra[0]} cannot be made; choose another")
    friction = {"friction": declared.friction} if read else {}
    return {"faces": declared.faces, "side": declared.side, **friction}


def _bar(q: Specification) -> dict[str, dict[str, Any]]:
    bar = q.transmission.bar
    if bar is None:
        return {}
    return {
        "transmission.bar": {
            "diameter": _mm(bar.diameter),
            "length": _mm(bar.length),
            "youngs_modulus": f"{bar.youngs_modulus / 1e9:.9g} GPa",
            "density": f"{bar.density:.9g} kg/m^3",
            "poisson": bar.poisson,
        }
    }


def _channel(channel: ChannelTable) -> dict[str, Any]:
    droop = {} if channel.time_constant is None else {"time_constant": _us(channel.time_constant)}
    return {"compression": channel.compression, **droop}


def _no_droop(q: Specification) -> dict[str, str]:
    """A time constant without effect, if [incident_force] would otherwise inherit that of [force]."""
    taken_over = q.transmitted.time_constant is not None and q.incident.time_constant is None
    return {"time_constant": f"{_NO_DROOP:.9g} s"} if taken_over else {}


def _uncertainty(given: Mapping[str, Any]) -> dict[str, Any]:
    """[uncertainty] as written, every quantity in its SI unit."""
    plain = {"poisson", "friction", "bar_poisson", "bars_alike"}
    lengths = dict.fromkeys(("Z_offset", "y_offset", "gauge_distance", "length_in_pictures"), "m")
    units = {"damping": "s", "clock_offset": "s", **lengths}
    return {
        key: value if key in plain else _quantity(value, units.get(key, "")) for key, value in given.items()
    }


def _value(value: Any) -> str:
    """A value in TOML syntax; tables are inline."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {_value(item)}" for key, item in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_value(item) for item in value) + "]"
    return repr(value)


def _mm(metres: float) -> str:
    return f"{metres * 1e3:.9g} mm"


def _us(seconds: float) -> str:
    return f"{seconds * 1e6:.9g} us"


MOTION = "motion.csv"
"""File with the flyer's path of the shot, in the folder of the specification."""
KNOT = 2e-6
"""Time step of its samples [s]."""


_UNITS = {"diameter": "m", "length": "m", "density": "kg/m^3", "youngs_modulus": "Pa", "shear_modulus": "Pa"}
_UNITS |= {"damping": "s", "mass_damping": "1/s"}
STEEL = ("youngs_modulus", "density", "poisson")
"""Keys of a bar's material."""


def si_texts(record: object, *names: str) -> dict[str, Any]:
    """Attributes of a record as TOML values: texts with SI units, and plain ones as they are."""
    values = {name: getattr(record, name) for name in names}
    return {
        name: _quantity(value, _UNITS[name]) if name in _UNITS else value for name, value in values.items()
    }


def specification_of(shot: Shot, folder: Path, *, answer: Mapping[str, float]) -> Path:
    """Write the specification of a shot, and its flyer's path; returns the specification's file.

    ``shot``: with a flyer, an outline and a force channel. ``answer``: identified parameters by name. Missing
    ones have the shot file's values, and the stiffness factor is 1.
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
        "specimen": si_texts(shot.specimen, "diameter", "length", "density"),
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
        "interface": si_texts(shot.interface, "faces", "side", "friction"),
        "transmission": {"support": "rigid" if bar is None else "bar"},
        "motion": {"kind": "sampled", "file": MOTION, "start": f"{start:.9g} s", "compression": "75 %"},
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
        tables["transmission.bar"] = si_texts(bar, "diameter", "length", *STEEL)
    sizes = declared_sizes(shot.uncertainty)
    if sizes:
        tables["budget"] = {json.dumps(key): size for key, size in sizes.items()}
    made = folder / "SPEC.toml"
    text = toml_text(tables, name=shot.name, head=f"# The test of {shot.name} in the virtual laboratory.\n")
    made.write_text(text, encoding="utf-8")
    return made


def declared_sizes(uncertainty: Mapping[str, float]) -> dict[str, str | float]:
    """A shot's declared standard uncertainties as keys and sizes of a budget. Uncertainties of 0 are left
    out."""
    sizes: dict[str, str | float] = {}
    for key, sigma in uncertainty.items():
        one = INPUTS.get(key)
        if one is not None and one.laboratory is not None and sigma > 0.0:
            plain = one.unit == "1" and not one.relative
            unit = "" if one.unit == "1" else one.unit
            sizes[one.laboratory.key] = sigma if plain else f"{sigma:.9g} {unit}".rstrip()
    return sizes


def yeoh_of(curve: MaterialCurve) -> tuple[dict[str, float], float]:
    """Yeoh's law through a curve: constants divided by the shear modulus, and the shear modulus [Pa]. The law
    is linear in its constants: non-negative least squares in the stress, weighted by its sigma."""
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
