"""The specimen's boundary: the flyer's motion, the support's wave, and a node that meets a platen."""

from dataclasses import dataclass
from functools import cache
from typing import Any

import warp as wp

from explicit.contact import contact_law
from explicit.precision import Precision
from explicit.structs import Structs

INTERIOR, LOWER, UPPER, SIDE = 0, 1, 2, 3
"""Node kinds: which platen a node can meet; LOWER and UPPER also mark the platen it has touched."""

BAR_HISTORY = 1024
"""Samples per round trip of the wave stored for a characteristic bar."""


@dataclass(frozen=True)
class BoundaryFunctions:
    """The boundary of one pair of contact laws and precision."""

    platen_position: Any
    """``platen_position(batch, motion, time)``: displacement of a platen whose motion is tabulated [m]."""
    returned_wave: Any
    """``returned_wave(state, sample, elapsed, round_trip)``: h(t) of `explicit.support` [m/s]."""
    meet: Any
    """``meet(kind, touched, free, to_lower, to_upper, friction) -> (velocity, platen, touched)``."""


@cache
def boundary_functions(faces: str, side: str, precision: Precision, structs: Structs) -> BoundaryFunctions:
    """Generate the boundary for two contact laws."""
    real, vec2 = precision.real, precision.vec2
    Batch, State = structs.Batch, structs.State
    face_contact = contact_law(faces).kernel_function(precision)
    side_contact = contact_law(side).kernel_function(precision)
    ZERO = wp.float64(0.0)
    lower, upper, on_side = int(LOWER), int(UPPER), int(SIDE)
    history, twice = int(BAR_HISTORY), int(2 * BAR_HISTORY)

    @wp.func
    def platen_position(batch: Batch, motion: int, time: wp.float64):
        last = batch.motion_table.shape[1] - 1
        place = (time - batch.start) * batch.motion_rate[motion]
        k = wp.clamp(int(place), 0, last)
        x = place - wp.float64(k)
        f, d = batch.motion_table[motion, k, 0], batch.motion_table[motion, k, 1]
        a, c = batch.motion_table[motion, k, 2], batch.motion_table[motion, k, 3]
        return f + x * (d + x * (a + x * c))

    @wp.func
    def returned_wave(state: State, sample: int, elapsed: wp.float64, round_trip: wp.float64):
        """The wave h(t) = g(t - 2 L / c) that comes back from the bar's free end."""
        wave = wp.float64(0.0)
        late = elapsed - round_trip
        if late > ZERO:
            place = late / round_trip * wp.float64(history)
            k = int(place)
            share = place - wp.float64(k)
            early = state.bar_wave[sample, k % twice]
            later = state.bar_wave[sample, (k + 1) % twice]
            wave = early + share * (later - early)
        return wave

    @wp.func
    def meet(
        kind: int,
        touched: int,
        free: vec2,
        to_lower: real,
        to_upper: real,
        friction: real,
    ):
        """Admissible velocity of a boundary node, the platen it met (or 0) and its new touch mark."""
        new, platen, mark = vec2(free), int(0), int(touched)
        if kind == lower:
            new = face_contact(free[0], free[1], to_lower, real(1.0), touched, friction)
            platen = lower
        elif kind == upper:
            new = face_contact(free[0], free[1], to_upper, real(-1.0), touched, friction)
            platen = upper
        elif touched == lower or (touched == 0 and free[1] < to_lower):
            new = side_contact(free[0], free[1], to_lower, real(1.0), int(touched == lower), friction)
            platen = lower
        elif touched == upper or (touched == 0 and free[1] > to_upper):
            new = side_contact(free[0], free[1], to_upper, real(-1.0), int(touched == upper), friction)
            platen = upper
        if kind == on_side and (free[1] < to_lower or free[1] > to_upper):
            mark = platen
        return new, platen, mark

    return BoundaryFunctions(platen_position, returned_wave, meet)
