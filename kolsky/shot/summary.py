"""Summary of a loaded shot: named values with units, for a table or for JSON."""

from pathlib import Path
from typing import Any

import numpy as np

from dic.files import one_line
from kolsky.readers.found_layout import layout_in_words
from kolsky.shot.bar_check import CheckedBars, bar_rows, undeclared
from kolsky.shot.records import PicturedShot, Shot, ShotBase
from kolsky.shot.schema.apparatus import CONTACT_KEYS, keys_read
from kolsky.shot.schema.uncertainty import IDENTIFIED, REDUCED, UNITS
from kolsky.shot.summary_entry import Entry
from kolsky.shot.summary_measured import (
    centre_line_entries,
    force_entries,
    motion_entries,
    picture_entries,
    window_entries,
)

EXACT = "not declared: taken as exact"
"""Value of an uncertainty that [uncertainty] does not hold."""
TABLES = (".csv", ".txt", ".tsv", ".dat", ".asc", ".prn")
"""Endings of files that may be tables of text."""


def summarise(shot: ShotBase | CheckedBars) -> list[Entry]:
    """All entries of a shot's summary, in the order of the shot file."""
    if isinstance(shot, CheckedBars):
        entries = [Entry(*row) for row in bar_rows(shot)]
        entries += [
            Entry("uncertainty", key, value)
            for key in REDUCED
            if (value := shot.given.uncertainty.get(key, 0.0)) > 0.0
        ]
        return entries + [Entry("uncertainty", key, EXACT) for key in undeclared(shot)]
    return [
        Entry("specimen", "diameter", shot.specimen.diameter, "m"),
        Entry("specimen", "length", shot.specimen.length, "m"),
        Entry("specimen", "density", shot.specimen.density, "kg/m^3"),
        Entry("interface", "faces", shot.interface.faces),
        Entry("interface", "side", shot.interface.side),
        *(
            Entry("interface", name, getattr(shot.interface, name), CONTACT_KEYS[name].unit)
            for name in keys_read(shot.interface.faces, shot.interface.side)
        ),
        Entry("transmission", "support", shot.support),
        *_bar(shot),
        *_bodies(shot),
        *force_entries(shot),
        *(motion_entries(shot) if isinstance(shot, Shot) else []),
        *(centre_line_entries(shot.centre_line, shot) if isinstance(shot, Shot) and shot.centre_line else []),
        *(picture_entries(shot) if isinstance(shot, PicturedShot) else []),
        *_curve(shot),
        Entry("model", "poisson", shot.model.poisson),
        Entry("model", "damping", shot.model.damping, "s"),
        Entry("model", "damping_kind", shot.model.damping_kind),
        Entry("model", "mass_damping", shot.model.mass_damping, "1/s"),
        *(window_entries(shot) if isinstance(shot, Shot) else []),
        *_uncertainty(shot),
        *_layouts(shot),
    ]


def as_json(shot: ShotBase | CheckedBars) -> dict[str, Any]:
    """The summary as one JSON object: section -> name -> {value, unit}, SI."""
    result: dict[str, Any] = {"shot": shot.name, "folder": str(shot.folder)}
    for entry in summarise(shot):
        section = result.setdefault(entry.section, {})
        section[entry.name.replace(" ", "_")] = {"value": entry.value, "unit": entry.unit or None}
    result["inputs"] = dict(shot.inputs)
    return result


def _layouts(shot: ShotBase) -> list[Entry]:
    """How the tables that are no plain text are read; of a series of files the first stands for all."""
    found = (
        (name, layout_in_words(_first(shot.folder / name))) for name in shot.inputs if name.endswith(TABLES)
    )
    return [Entry("layouts", name, words) for name, words in found if words]


def _first(place: Path) -> Path:
    """A file, or the first of those that a pattern such as `dic_*.csv` names."""
    return place if place.exists() else min(place.parent.glob(place.name), default=place)


def _bar(shot: ShotBase) -> list[Entry]:
    bar = shot.transmission_bar
    if bar is None:
        return []
    return [
        Entry("transmission", "bar impedance", bar.impedance, "N s/m"),
        Entry("transmission", "bar round trip", bar.round_trip, "s"),
    ]


def _bodies(shot: ShotBase) -> list[Entry]:
    """Elastic parts on both sides, and the incident force that is compared."""
    rows = []
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
    used = [key for key in IDENTIFIED if key != "friction" or key in read]
    return [
        Entry("uncertainty", key, shot.uncertainty[key], UNITS.get(key, ""))
        if key in shot.uncertainty
        else Entry("uncertainty", key, EXACT)
        for key in used
    ]


def _curve(shot: ShotBase) -> list[Entry]:
    curve = shot.curve
    loaded = curve.stress != 0.0
    relative = curve.total_sigma[loaded] / np.abs(curve.stress[loaded])
    common = 0 if curve.modes is None else len(curve.modes)
    other = [] if curve.conditioned is None else [Entry("curve", "conditioned curve", "yes")]
    law = [] if curve.law is None else [Entry("curve", "law", curve.law.NAME)]
    return [
        *law,
        Entry("curve", "branch", "compression" if curve.stretch[-1] < 1.0 else "tension"),
        Entry("curve", "points", int(curve.stretch.size)),
        Entry("curve", "stretch at the end", float(curve.stretch[-1])),
        Entry("curve", "stress at the end", float(curve.stress[-1]), "Pa"),
        Entry("curve", "smallest relative sigma", float(relative.min())),
        Entry("curve", "largest relative sigma", float(relative.max())),
        *([Entry("curve", "uncertainties common to all points", common)] if common else []),
        *other,
    ]


def print_table(shot: ShotBase | CheckedBars) -> None:
    """Print the summary as a table on stdout, with the first 16 digits of each file's hash."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    # Text() keeps column names such as "[V]" from being read as markup.
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
