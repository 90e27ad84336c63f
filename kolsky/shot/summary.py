"""Summary of a loaded shot: named values with units, for a table or for JSON."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from dic.files import one_line
from kolsky.bars.flyer.front_path import BarForce
from kolsky.base.records import FlyerMotion
from kolsky.pictures.picture_set import CAMERAS, readable
from kolsky.readers.contents import clock_words
from kolsky.readers.table import layout_in_words
from kolsky.schema.apparatus import CONTACT_KEYS, IDENTIFY_KEYS, REDUCTION_KEYS, keys_read
from kolsky.shot.bars import SIZES, CheckedBars, bar_rows
from kolsky.shot.inputs import INPUTS
from kolsky.shot.plausibility import evidence_of, gate
from kolsky.shot.records import PicturedShot, Shot, ShotBase

ABSOLUTE = 0.1
"""Times after this are not written in microseconds [s]. They would lose their last digits."""
_WRITTEN = {"1": ("um/m", 1e6), "m": ("mm", 1e3), "s": ("us", 1e6), "Pa": ("kPa", 1e-3)}


@dataclass(frozen=True)
class Entry:
    """One line of the summary."""

    section: str
    """The table of the shot file that contains the value."""
    name: str
    """Its description."""
    value: float | int | str
    """Its value, SI."""
    unit: str = ""
    """SI unit; empty for counts, ratios and words."""

    def written(self) -> str:
        """The value in practical units, e.g. "9.5 mm"."""
        if isinstance(self.value, str):
            return self.value
        if self.unit == "s" and abs(self.value) >= ABSOLUTE:
            return f"{self.value:.9f} s"
        unit, factor = _WRITTEN.get(self.unit, (self.unit, 1.0))
        if self.unit == "m" and 0.0 < abs(self.value) < 1e-4:
            unit, factor = "um", 1e6
        if self.unit == "Pa" and abs(self.value) >= 1e9:
            unit, factor = "GPa", 1e-9
        return f"{self.value * factor:.6g} {unit}".strip()


def _inside(shot: Shot, time: np.ndarray) -> np.ndarray:
    return (time >= shot.window[0]) & (time <= shot.window[1])


def _window_entries(shot: Shot) -> list[Entry]:
    """The window, and its number of front-face samples."""
    (start, end), time = shot.window, shot.flyer.time
    what = "frames" if isinstance(shot.flyer, FlyerMotion) else "samples"
    spans = {"start": start, "end": end, "duration": end - start}
    where = {"inside": _inside(shot, time), "before it": time < start, "after it": time > end}
    return [
        *(Entry("window", name, value, "s") for name, value in spans.items()),
        *(Entry("window", f"{what} {name}", int(found.sum())) for name, found in where.items()),
    ]


def _picture_entries(shot: PicturedShot) -> list[Entry]:
    """The pictures of both cameras, and the settings of their correlation."""
    declared = shot.pictures.toml.declared
    assert declared.pictures is not None  # else there is no such shot
    assert declared.calibration is not None
    assert declared.dic is not None
    rows = [
        Entry("frames", "frames", shot.pictures.time.size),
        _clock("frames", shot.pictures.time),
        Entry("frames", "static", declared.frames.static),
    ]
    for name, section, series in zip(CAMERAS, declared.pictures.cameras, shot.pictures.series, strict=True):
        height, width = series.shape
        x, y = series.crop_offset
        rows += [
            Entry("pictures", f"{name}, files", section.source[1]),
            Entry("pictures", f"{name}, size", f"{width} x {height} px at ({x:g}, {y:g}) of the sensor"),
            Entry("pictures", f"{name}, bits", series.bits),
        ]
        missing = shot.pictures.time.size - readable(series)
        if missing:
            rows.append(Entry("pictures", f"{name}, pictures cut off", missing))
    calibration, dic = declared.calibration, declared.dic
    source = calibration.file or f"pictures of a target: {calibration.camera_0}, {calibration.camera_1}"
    return [
        *rows,
        Entry("calibration", "from", source),
        Entry("dic", "subset", f"{dic.subset} px, {dic.shape}"),
        Entry("dic", "step", f"{dic.step} px"),
        Entry("dic", "flyer_side", dic.flyer_side),
        Entry("dic", "strip_half_width", dic.strip_half_width, "m"),
    ]


def _clock(section: str, time: np.ndarray, what: str = "samples") -> Entry:
    """Rate, number of samples and duration of a record."""
    step = float(np.median(np.diff(time))) if time.size > 1 else 0.0
    words = clock_words(step, int(time.size)) if step > 0.0 else "one sample"
    return Entry(section, "clock", words.replace("samples", what))


def _force_entries(shot: ShotBase) -> list[Entry]:
    """The force: its record, its noise, its largest values."""
    channel = shot.force
    if isinstance(channel, BarForce):
        force = channel.raw_force()
        return [
            Entry("force", "from", "waves in the transmission bar"),
            Entry("force", "samples", int(force.size)),
            _clock("force", channel.time),
            Entry("force", "record start", float(channel.time[0]), "s"),
            Entry("force", "record end", float(channel.time[-1]), "s"),
            Entry("force", "noise of the force", float(np.median(channel.measured.sigma)), "N"),
            Entry("force", "sigma of its scale", channel.sigma_gain),
            Entry("force", "largest compression", float(force.max()), "N"),
            Entry("force", "largest tension", float(-force.min()), "N"),
        ]
    time, volts, zero = channel.time, channel.recording.value, channel.baseline_volts()
    noise = float(zero.std(ddof=1))
    return [
        Entry("force", "channel", channel.recording.channel),
        Entry("force", "samples", int(volts.size)),
        _clock("force", time),
        Entry("force", "sample step", float(np.median(np.diff(time))), "s"),
        Entry("force", "record start", float(time[0]), "s"),
        Entry("force", "record end", float(time[-1]), "s"),
        Entry("force", "sensitivity", channel.transducer.sensitivity, "V/N"),
        Entry("force", "compression", "positive" if channel.transducer.compression_sign > 0 else "negative"),
        Entry("force", "full_scale", channel.transducer.full_scale, "V"),
        Entry("force", "largest voltage", float(np.abs(volts).max()), "V"),
        Entry("force", "baseline start", channel.baseline[0], "s"),
        Entry("force", "baseline end", channel.baseline[1], "s"),
        Entry("force", "baseline samples", int(zero.size)),
        Entry("force", "baseline zero", float(zero.mean()), "V"),
        Entry("force", "baseline noise", noise, "V"),
        Entry("force", "noise of the force", noise / channel.transducer.sensitivity, "N"),
        Entry("force", "largest compression", float(channel.raw_force().max()), "N"),
        Entry("force", "largest tension", float(-channel.raw_force().min()), "N"),
    ]


def _motion_entries(shot: Shot) -> list[Entry]:
    """The motion of the front face, from pictures or from waves."""
    motion = shot.flyer
    if isinstance(motion, FlyerMotion):
        moved = motion.displacement
        rest = moved[motion.time <= shot.window[0]]
        scatter = [Entry("flyer", "scatter at rest", float(rest.std(ddof=1)), "m")] if rest.size > 1 else []
        return [
            Entry("flyer", "frames", int(motion.time.size)),
            _clock("flyer", motion.time, "frames"),
            Entry("flyer", "first frame", float(motion.time[0]), "s"),
            Entry("flyer", "last frame", float(motion.time[-1]), "s"),
            Entry("flyer", "travel in the window", float(np.ptp(moved[_inside(shot, motion.time)])), "m"),
            Entry("flyer", "sigma", float(motion.sigma.max()), "m"),
            *scatter,
        ]
    return [
        Entry("motion", "from", "waves in the incident bar"),
        Entry("motion", "samples", int(motion.time.size)),
        _clock("motion", motion.time),
        Entry("motion", "sample step", float(np.median(np.diff(motion.time))), "s"),
        Entry("motion", "largest velocity", float(motion.velocity.max()), "m/s"),
        Entry("motion", "noise of the velocity", motion.noise, "m/s"),
        Entry("motion", "sigma of its scale", motion.sigma_gain),
    ]


def _centre_line_entries(shot: Shot) -> list[Entry]:
    """The outline: its points, and the frames with points."""
    line = shot.centre_line
    if line is None:
        return []
    inside = _inside(shot, line.time)
    _, counts = np.unique(line.frame[inside], return_counts=True)
    return [
        Entry("centre_line", "points", int(line.Z.size)),
        Entry("centre_line", "points in the window", int(inside.sum())),
        Entry("centre_line", "frames with points in the window", int(counts.size)),
        Entry("centre_line", "fewest points in a frame", int(counts.min())),
        Entry("centre_line", "most points in a frame", int(counts.max())),
        *(
            Entry("centre_line", f"{words} {name}", float(end(getattr(line, name))), "m")
            for name in ("y", "Z", "sigma")
            for words, end in (("smallest", np.min), ("largest", np.max))
        ),
    ]


EXACT = "not declared: taken as exact"
"""Text for an uncertainty that [uncertainty] does not declare."""
TABLES = (".csv", ".txt", ".tsv", ".dat", ".asc", ".prn")
"""Endings of files that may be tables of text."""


def summarise(shot: ShotBase | CheckedBars) -> list[Entry]:
    """All entries of a shot's summary, in the order of the shot file."""
    if isinstance(shot, CheckedBars):
        stated = {k: v for k in REDUCTION_KEYS if (v := shot.given.uncertainty.get(k, 0.0)) > 0.0}
        other = {"bar_modulus": "bar_wave_speed", "bar_wave_speed": "bar_modulus"}  # one of them is enough
        exact = [key for key in REDUCTION_KEYS if key not in stated and other.get(key) not in stated]
        uncertainty: dict[str, float | str] = {**stated, **dict.fromkeys(exact, EXACT)}
        return [
            *(Entry(*row) for row in bar_rows(shot)),
            *(Entry("uncertainty", key, value) for key, value in uncertainty.items()),
        ]
    return [
        *(Entry("specimen", key, getattr(shot.specimen, key), unit) for key, unit in SIZES.items()),
        Entry("interface", "faces", shot.interface.faces),
        Entry("interface", "side", shot.interface.side),
        *(
            Entry("interface", name, getattr(shot.interface, name), CONTACT_KEYS[name].unit)
            for name in keys_read(shot.interface.faces, shot.interface.side)
        ),
        Entry("transmission", "support", shot.support),
        *_bodies(shot),
        *_force_entries(shot),
        *(_motion_entries(shot) if isinstance(shot, Shot) else []),
        *(_centre_line_entries(shot) if isinstance(shot, Shot) else []),
        *(_picture_entries(shot) if isinstance(shot, PicturedShot) else []),
        *_curve(shot),
        Entry("model", "poisson", shot.model.poisson),
        Entry("model", "damping", shot.model.damping, "s"),
        Entry("model", "damping_kind", shot.model.damping_kind),
        Entry("model", "mass_damping", shot.model.mass_damping, "1/s"),
        *(_window_entries(shot) if isinstance(shot, Shot) else []),
        *_uncertainty(shot),
        *_layouts(shot),
    ]


def remarks(shot: ShotBase | CheckedBars) -> list[str]:
    """Anomalies of the inputs and unlikely combinations of them, one sentence each."""
    if isinstance(shot, CheckedBars):
        return list(shot.given.notes)
    if isinstance(shot, Shot):
        return [*(shot.flyer.notes if isinstance(shot.flyer, FlyerMotion) else ()), *shot.notes]
    known = evidence_of(shot)
    return [] if known is None else list(gate(known))


def as_json(shot: ShotBase | CheckedBars) -> dict[str, Any]:
    """The summary as one JSON object: section -> name -> {value, unit}, SI; and the remarks."""
    result: dict[str, Any] = {"shot": shot.name, "folder": str(shot.folder)}
    for entry in summarise(shot):
        section = result.setdefault(entry.section, {})
        section[entry.name.replace(" ", "_")] = {"value": entry.value, "unit": entry.unit or None}
    result["inputs"] = dict(shot.inputs)
    result["warnings"] = remarks(shot)
    return result


def _layouts(shot: ShotBase) -> list[Entry]:
    """The layout of tables that need one. A series of files is described by its first file."""
    found = []
    for name in filter(lambda name: name.endswith(TABLES), shot.inputs):
        place = shot.folder / name  # or a pattern such as `dic_*.csv`
        first = place if place.exists() else min(place.parent.glob(place.name), default=place)
        if words := layout_in_words(first):
            found.append(Entry("layouts", name, words))
    return found


def _bodies(shot: ShotBase) -> list[Entry]:
    """The bar and the elastic parts on both sides, and the incident force that is compared."""
    rows = []
    if (bar := shot.transmission_bar) is not None:
        rows += [
            Entry("transmission", "bar impedance", bar.impedance, "N s/m"),
            Entry("transmission", "bar round trip", bar.round_trip, "s"),
        ]
    for table, body in (("transmission", shot.behind), ("flyer_body", shot.flyer_body)):
        if body is not None:
            rows += [
                Entry(table, "model", body.model),
                Entry(table, "parts", len(body.parts)),
                Entry(table, "length of the parts", body.length, "m"),
                Entry(table, "transducer depth", body.transducer_depth, "m"),
            ]
    if shot.incident is not None:
        noise = float(np.std(shot.incident.channel.baseline_volts(), ddof=1))
        sensitivity = shot.incident.channel.transducer.sensitivity
        rows.append(Entry("incident_force", "noise of the force", noise / sensitivity, "N"))
        if shot.flyer_body is None:
            rows.append(Entry("incident_force", "mass before it", shot.incident.mass, "kg"))
    return rows


def _uncertainty(shot: ShotBase) -> list[Entry]:
    """Declared standard uncertainties, and the keys that are not declared."""
    read = keys_read(shot.interface.faces, shot.interface.side)
    used = [key for key in IDENTIFY_KEYS if key != "friction" or key in read]
    return [
        Entry("uncertainty", key, shot.uncertainty[key], "" if INPUTS[key].unit == "1" else INPUTS[key].unit)
        if key in shot.uncertainty
        else Entry("uncertainty", key, EXACT)
        for key in used
    ]


def _curve(shot: ShotBase) -> list[Entry]:
    curve = shot.curve
    loaded = curve.stress != 0.0
    relative = curve.total_sigma[loaded] / np.abs(curve.stress[loaded])
    common = 0 if curve.modes is None else len(curve.modes)
    return [
        *([] if curve.law is None else [Entry("curve", "law", curve.law.NAME)]),
        Entry("curve", "branch", "compression" if curve.stretch[-1] < 1.0 else "tension"),
        Entry("curve", "points", int(curve.stretch.size)),
        Entry("curve", "stretch at the end", float(curve.stretch[-1])),
        Entry("curve", "stress at the end", float(curve.stress[-1]), "Pa"),
        Entry("curve", "smallest relative sigma", float(relative.min())),
        Entry("curve", "largest relative sigma", float(relative.max())),
        *([Entry("curve", "uncertainties common to all points", common)] if common else []),
        *([] if curve.conditioned is None else [Entry("curve", "conditioned curve", "yes")]),
    ]


def print_table(shot: ShotBase | CheckedBars) -> None:
    """Print the summary as a table on stdout, with the first 16 digits of each file's hash."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    # Text() prevents that column names such as "[V]" are read as markup.
    table = Table(title=Text(one_line(f"shot {shot.name}")), show_edge=False)
    for heading in ("", "what", "value"):
        table.add_column(heading, overflow="fold")
    section = ""
    for entry in summarise(shot):
        if entry.section != section and section:
            table.add_section()
        shown = entry.section if entry.section != section else ""
        section = entry.section
        table.add_row(Text(shown), Text(one_line(entry.name)), Text(one_line(entry.written())))
    table.add_section()
    for number, (name, digest) in enumerate(shot.inputs.items()):
        table.add_row(
            Text("inputs" if number == 0 else ""), Text(one_line(name)), Text(f"sha256 {digest[:16]}…")
        )
    Console().print(table)
