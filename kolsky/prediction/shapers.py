"""Laws of pulse shapers: a disc of rubber, a measured table, and what a measured pulse says.

The pulse of a test between striker and incident bar contains the shaper's law. Its force F(t) on the bar's
face is the incident wave there, as long as nothing has come back from the bar's far end. The faces move at

    v_bar = F(t) / Z_bar,    v_striker = V - [F(t) + 2 sum_k F(t - k T)] / Z_striker,          Eq. (PS.1)

with the striker's round trip T = 2 L / c_0: its free rear end sends every wave back with its sign changed.
The shaper's compression is the integral of v_striker - v_bar, and F over it the law, nothing chosen.
"""

from pathlib import Path

import numpy as np
from scipy.integrate import cumulative_trapezoid

from explicit.bars import PulseShaper, Section
from kolsky.base.arrays import FloatArray
from kolsky.base.errors import InputError
from kolsky.prediction.schema import ShaperTable
from kolsky.readers.table import Column, read_table
from kolsky.virtual.motion import disc, loading

LEAST_POINTS = 8
"""Fewest points of a law's loading."""
LAW_POINTS = 400
"""Most points of a law from a pulse, evenly in compression."""
LOADED = (0.01, 0.03)
"""Shares of the largest force of a pulse between which a line is laid: where it has none, loading begins."""


def closing(
    time: FloatArray, force: FloatArray, *, striker: Section, incident: Section, speed: float
) -> FloatArray:
    """Compression of the shaper under a pulse [m], Eq. (PS.1), shape [n].

    ``time``: ascending, from the striker's touch [s], shape [n]. ``force``: compressive force on the bar's
    face [N], shape [n]; nothing before the first time. ``striker``, ``incident``: the bars of that test.
    ``speed``: the striker's before it touched [m/s].
    """
    round_trip = 2.0 * striker.travel_time
    returned = np.zeros(len(time))
    for k in range(1, int((time[-1] - time[0]) / round_trip) + 1):
        returned += np.interp(time - k * round_trip, time, force, left=0.0)
    velocity = speed - (force + 2.0 * returned) / striker.impedance - force / incident.impedance
    return np.asarray(cumulative_trapezoid(velocity, time, initial=0.0))


def from_pulse(
    time: FloatArray,
    force: FloatArray,
    *,
    striker: Section,
    incident: Section,
    speed: float,
    unloading: float | None = None,
) -> PulseShaper:
    """The law that a measured pulse contains; arguments as of `closing`.

    The loading curve ends at the largest force. Where noise makes force or compression fall on the way, the
    curve keeps the larger value. Unloading is the mean slope from there to half the force, if the shaper
    springs back that far within the pulse, else the steepest of loading.
    """
    compression = closing(time, force, striker=striker, incident=incident, speed=speed)
    top = int(np.argmax(force))
    if not force[top] > 0.0 or top < LEAST_POINTS:
        raise ValueError("the pulse has no rising force; is its sign compression-positive?")
    if not (np.diff(compression[: top + 1]) > 0.0).mean() > 0.9:
        raise ValueError(
            "the faces of the shaper part while the force rises: speed, bars or the force's scale are wrong"
        )
    x = np.maximum.accumulate(compression[: top + 1])
    rising = np.maximum.accumulate(force[: top + 1])
    grid = np.linspace(0.0, x[-1], LAW_POINTS + 1)
    law = np.interp(grid, x, rising)
    law[0] = 0.0
    keep = np.concatenate([[True], np.diff(np.maximum.accumulate(law)) > 1e-9 * law[-1]])
    if keep.sum() < LEAST_POINTS:
        raise ValueError(f"the pulse has {keep.sum()} points of loading, {LEAST_POINTS} are needed")
    found = loading(grid[keep], law[keep])
    springs = unloading if unloading is not None else _unloading(compression[top:], force[top:])
    return found if springs is None else loading(grid[keep], law[keep], max(springs, found.unloading))


def _from_touch(time: FloatArray, force: FloatArray) -> tuple[FloatArray, FloatArray]:
    """A recorded pulse from the striker's touch on: times [s] from 0 and forces [N], the first of them 0.

    The touch itself drowns in noise. A shaper's force rises in a straight line at first, as the faces close
    at one speed: the line through its first passages of two small forces, `LOADED`, leads back to it.
    """
    top = float(force.max(initial=0.0))
    passages = [np.flatnonzero(force >= share * top) for share in LOADED]
    first, second = (int(rows[0]) if top > 0.0 else 0 for rows in passages)
    if not second > first > 0:
        raise ValueError("the pulse does not rise from nothing: the record must begin before it")
    slope = (force[second] - force[first]) / (time[second] - time[first])
    touch = float(time[first] - force[first] / slope)
    return np.append(0.0, time[first:] - touch), np.append(0.0, force[first:])


def _unloading(compression: FloatArray, force: FloatArray) -> float | None:
    """Mean slope from the largest compression to half the force there; None if it does not spring back."""
    turn = int(np.argmax(compression))
    below = np.flatnonzero(force[turn:] <= 0.5 * force[turn])
    if not below.size:
        return None
    end = turn + int(below[0])
    back = float(compression[turn] - compression[end])
    return float((force[turn] - force[end]) / back) if back > 0.0 else None


def shaper_of(table: ShaperTable, folder: Path, *, striker: Section, incident: Section) -> PulseShaper | None:
    """The pulse shaper that a test declares; None for face on face.

    ``table``: [shaper]. ``striker``, ``incident``: the bars, which a pulse is read with.
    """
    if table.kind == "none":
        return None
    if table.kind == "disc":
        assert table.diameter is not None  # the schema asks for them
        assert table.height is not None
        assert table.shear_modulus is not None
        law = disc(table.diameter, table.height, table.shear_modulus)
        return law if table.unloading is None else _made(law.compression, law.force, table, folder)
    assert table.file is not None
    path = folder / table.file
    contents = read_table(path)
    force = contents.values(Column("force (N)"))
    if table.kind == "table":
        return _made(contents.values(Column("compression (mm)", 1e-3)), force, table, path)
    time = contents.values(Column("time (us)", 1e-6))
    assert table.speed is not None
    try:
        return from_pulse(
            *_from_touch(time, force),
            striker=striker,
            incident=incident,
            speed=table.speed,
            unloading=table.unloading,
        )
    except ValueError as error:
        raise InputError(
            path, str(error), key="shaper.file", cure="are its columns and units right?"
        ) from None


def _made(compression: FloatArray, force: FloatArray, table: ShaperTable, path: Path) -> PulseShaper:
    try:
        return loading(compression, force, table.unloading)
    except (ValueError, IndexError) as error:
        raise InputError(
            path, str(error), key="shaper", cure="give a pulse that was recorded with this shaper"
        ) from None
