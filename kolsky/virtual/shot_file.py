"""The shot.toml of a made shot: what its laboratory believes, which is the truth but for [imperfections]."""

import json
from collections.abc import Mapping
from typing import Any

from kolsky.shot.schema.relaxation import RelaxationSection
from kolsky.virtual.records import SurfaceHistory
from kolsky.virtual.schema import ChannelTable, Specification
from kolsky.virtual.scope_files import FORMATS

HEAD = "# Made by kolsky virtual make; its answer is in truth.json, which no other command reads.\n"
QUIET = 5e-6
"""How long before the last static frame the baseline ends [s]."""
NO_DROOP = 1e6
"""A time constant beside which a test is nothing [s]."""
SMALLEST_BASELINE = 20
"""Samples of the baseline that are needed to read its zero and noise."""

Tables = Mapping[str, Mapping[str, Any]]


def shot_tables(quantities: Specification, surface: SurfaceHistory) -> dict[str, dict[str, Any]]:
    """The tables of shot.toml as values that TOML has; quantities are texts with their units.

    Raises
    ------
    ValueError
        If the recorder starts too late for a baseline, or a declared value cannot be.
    """
    q, wrong = quantities, quantities.imperfections
    form = FORMATS[q.scope.format]
    incident, transmitted = form.columns
    poisson = q.material.poisson + wrong.poisson
    damping = q.material.damping + wrong.damping
    if not 0.0 <= poisson <= 0.4999 or damping < 0.0:
        raise ValueError(
            f"declared poisson = {poisson:g} and damping = {damping:g} s are not allowed; they must be in "
            "[0, 0.4999] and >= 0 s: change [imperfections]"
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
        tables["relaxation"] = _relaxation(q.relaxation)
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


def _relaxation(declared: RelaxationSection) -> dict[str, Any]:
    """[relaxation] as written, every quantity in its SI unit."""
    units = {"times": " s", "sigma_times": " s", "resistance": " Pa", "sigma_resistance": " Pa"}

    def text(key: str, value: Any) -> Any:
        if key not in units:
            return list(value) if isinstance(value, tuple) else value
        if isinstance(value, tuple):
            return [f"{one:.9g}{units[key]}" for one in value]
        return f"{value:.9g}{units[key]}"

    given = declared.model_dump(exclude_unset=True)
    return {key: text(key, value) for key, value in given.items() if value is not None}


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
    from kolsky.shot.schema.apparatus import keys_read

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
    """A time constant that changes nothing, where [incident_force] would take over that of [force]."""
    taken_over = q.transmitted.time_constant is not None and q.incident.time_constant is None
    return {"time_constant": f"{NO_DROOP:.9g} s"} if taken_over else {}


def _uncertainty(given: Mapping[str, Any]) -> dict[str, Any]:
    """[uncertainty] as written, every quantity in its SI unit."""
    plain = {"poisson", "friction", "bar_poisson", "bars_alike"}
    lengths = dict.fromkeys(("Z_offset", "y_offset", "gauge_distance", "length_in_pictures"), "m")
    units = {"damping": "s", "clock_offset": "s", **lengths}
    return {
        key: value if key in plain else f"{value:.9g} {units.get(key, '')}".strip()
        for key, value in given.items()
    }


def _value(value: Any) -> str:
    """A value as TOML writes it; tables inline."""
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
