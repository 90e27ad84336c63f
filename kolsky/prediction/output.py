"""A prediction as CSV tables and JSON, and as a specification of the virtual laboratory."""

from dataclasses import fields
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from kolsky.base.files import jsonable, write_table
from kolsky.prediction.design import Aim, Scan
from kolsky.prediction.predict import Numbers, Prediction, doubts
from kolsky.virtual.motion import MOVES
from kolsky.virtual.shot_file import KNOT, MOTION, toml_text

EVENTS = {
    "incident_rise": "incident wave arrives at the flyer",
    "striker_parts": "striker lets go",
    "tensile_dip": "joint is pulled",
    "separation": "flyer separates",
    "arrest": "flyer is arrested",
    "push_back": "specimen pushes it back",
    "second_impact": "second impact on the incident bar",
}
"""Events in words."""
EVERY = 1e-6
"""Time from one row of the signals to the next [s]."""


def signals(found: Prediction) -> dict[str, Any]:
    """Signals of bars, flyer and specimen as named columns, SI, units in the names."""
    bars, test = found.bars, found.test.declared
    step = max(1, round(EVERY / float(bars.times[1])))
    every = slice(None, None, step)
    flyer = next(iter(test.flyer.values()))
    return {
        "time (s)": bars.times[every],
        "incident bar, middle (N)": bars.incident.force(0.5 * test.incident.length)[every],
        "striker on shaper (N)": bars.shaper_force[every],
        "shaper compression (m)": bars.shaper_approach[every],
        "joint (N)": bars.joint_force[every],
        "joint gap (m)": bars.joint_gap[every],
        "flyer's first part, middle (N)": bars.flyer.force(0.5 * flyer.length)[every],
        "force on flyer (N)": bars.force_flyer[every],
        "force on transmission platen (N)": bars.force_transmission[every],
        "transmitted, at the sensor (N)": bars.transmission.force(found.test.sensor_depth())[every],
        "incident bar's end (m/s)": bars.incident.velocity(test.incident.length)[every],
        "flyer (m/s)": bars.flyer_velocity[every],
        "flyer (m)": bars.flyer_path[every],
        "transmission platen (m)": bars.support_path[every],
        "compression (1)": (bars.compression / test.specimen.length)[every],
    }


def events_table(found: Prediction) -> dict[str, Any]:
    """Events with their time and what flyer and specimen do then."""
    bars, length = found.bars, found.test.declared.specimen.length
    named = {words: getattr(found.events, name) for name, words in EVENTS.items()}
    known = {words: time for words, time in named.items() if np.isfinite(time)}
    at = np.round(np.array(list(known.values())) / bars.times[1]).astype(int)
    return {
        "event": list(known),
        "time (s)": list(known.values()),
        "flyer (m/s)": bars.flyer_velocity[at],
        "compression (1)": bars.compression[at] / length,
        "transmitted force (N)": bars.force_transmission[at],
    }


def scan_table(found: Scan) -> dict[str, Any]:
    """One row a point of a scan."""
    columns: dict[str, Any] = {
        f"{one.key} ({one.unit or '1'})": found.points[:, i] for i, one in enumerate(found.varied)
    }
    return columns | {f"{field.name} (SI)": found.column(field.name) for field in fields(Numbers)}


def to_json(found: Prediction, scanned: Scan | None = None, aimed: Aim | None = None) -> dict[str, Any]:
    """Everything but the histories as one JSON object, SI; what is not known is null."""
    said: dict[str, Any] = {
        "test": found.test.declared.name,
        "events": vars(found.events),
        "numbers": vars(found.numbers),
        "specimen": "static curve" if found.response is None else "finite elements",
        "passes": len(found.changes),
        "warnings": doubts(found),
    }
    if scanned is not None:
        said["scan"] = scan_table(scanned)
    if aimed is not None:
        said["aim"] = {**vars(aimed), "numbers": vars(aimed.numbers), "reached": aimed.reached}
    made: dict[str, Any] = jsonable(said, "prediction")
    return made


def tables(found: Prediction, scanned: Scan | None = None, aimed: Aim | None = None) -> dict[str, Any]:
    """Signals, events, with finite elements the outline at every recorded time, of a scan its points."""
    made = {"signals": signals(found), "events": events_table(found)}
    response = found.response
    if response is not None:
        n, k = response.surface_r.shape[1:]
        made["outline"] = {
            "time (s)": np.repeat(response.surface_times, k),
            "node": np.tile(np.arange(k), n),
            "r (m)": response.surface_r[0].ravel(),
            "y (m)": response.surface_y[0].ravel(),
        }
    return made if scanned is None else {**made, "scan": scan_table(scanned)}


LARGEST_RECORDED = 0.6
"""Largest nominal compression of the virtual shot [-]: as far as Mates et al. (2012) go."""
SHARE_OF_LARGEST = 0.95
"""Of the largest compression, where that is less: the flyer still moves toward the specimen."""


def write_specification(folder: Path, found: Prediction) -> Path:
    """Write `virtual.toml`, a specification for the virtual laboratory, and the flyer's path beside it.

    Specimen, material and interface are those of the test file. The parts behind the specimen become one bar
    of their whole length with the steel of the last one.

    Raises ValueError if the flyer does not move.
    """
    bars, test = found.bars, found.test.declared
    moved = np.flatnonzero(bars.flyer_path > MOVES)
    if not moved.size:
        raise ValueError("the flyer does not move before the end of [run] duration")
    first, every = max(int(moved[0]) - 1, 0), max(1, round(KNOT / float(bars.times[1])))
    until = found.events.arrest if isfinite(found.events.arrest) else float(bars.times[-1])
    keep = slice(first, max(round(until / float(bars.times[1])), first + 4 * every) + 1, every)
    path = bars.flyer_path[keep] - bars.flyer_path[first]
    write_table(folder / MOTION, {"time (s)": bars.times[keep] - bars.times[first], "displacement (m)": path})
    largest = min(LARGEST_RECORDED, SHARE_OF_LARGEST * found.numbers.largest_strain)
    parts, m = list(test.transmission.values()), test.material
    material: dict[str, Any] = {
        "law": m.law,
        "parameters": dict(m.parameters),
        "shear_modulus": f"{m.shear_modulus:.9g} Pa",
        "stiffness_factor": m.stiffness_factor,
        "poisson": m.poisson,
        "damping": f"{m.damping:.9g} s",
        "mass_damping": f"{m.mass_damping:.9g} 1/s",
    }
    if m.prony_strengths:
        material["prony_strengths"] = list(m.prony_strengths)
        material["prony_times"] = [f"{time:.9g} s" for time in m.prony_times]
    tables: dict[str, dict[str, Any]] = {
        "specimen": {
            "diameter": f"{test.specimen.diameter:.9g} m",
            "length": f"{test.specimen.length:.9g} m",
            "density": f"{test.specimen.density:.9g} kg/m^3",
        },
        "material": material,
        "interface": {
            "faces": test.interface.faces,
            "side": test.interface.side,
            "friction": test.interface.friction,
        },
        "transmission": {"support": "bar"},
        "transmission.bar": {
            "diameter": f"{parts[-1].diameter:.9g} m",
            "length": f"{sum(part.length for part in parts):.9g} m",
            "youngs_modulus": f"{parts[-1].youngs_modulus:.9g} Pa",
            "density": f"{parts[-1].density:.9g} kg/m^3",
            "poisson": parts[-1].poisson,
        },
        "motion": {"kind": "sampled", "file": MOTION, "compression": f"{100.0 * largest:.4g} %"},
    }
    head = (
        "# The predicted test for the virtual laboratory: kolsky virtual make virtual.toml --out SHOT\n"
        "# The flyer's path is that of the prediction; others have the defaults of `kolsky virtual new`.\n"
    )
    file = folder / "virtual.toml"
    file.write_text(toml_text(tables, name=test.name, head=head), encoding="utf-8")
    return file
