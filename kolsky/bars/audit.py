"""The audit log: every correction with its switch, its size and its reason, even if it was not applied."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kolsky.bars.records import Correction
from kolsky.base.arrays import BoolArray, FloatArray

CORRECTIONS: Mapping[str, tuple[bool, str]] = MappingProxyType(
    {
        "bridge nonlinearity": (True, "exact formula of the bridge instead of its slope at zero"),
        "bending": (True, "mean of opposed gauges instead of the first one alone"),
        "baseline drift": (False, "slope of the baseline, extrapolated over the pulse"),
        "droop": (True, "discharge of a piezoelectric transducer"),
        "dispersion": (True, "phase velocity of each frequency instead of the bar wave speed"),
        "separation": (True, "overlapping waves separated by two gauges"),
        "free end": (False, "removal of echoes from the bars' free far ends"),
        "reflected alignment": (False, "reflected wave moved to its observed arrival"),
        "transmitted alignment": (False, "transmitted wave moved to its observed arrival"),
        "punching": (True, "elastic indentation of the bars' faces by a smaller specimen"),
        "mass": (True, "inertia of the parts between sensor and specimen"),
        "radial inertia": (False, "pressure of the specimen's radial acceleration"),
        "axial inertia": (False, "momentum of the specimen itself"),
    }
)
"""Every switch: its default and its meaning. A new correction is one line here."""


@dataclass(frozen=True)
class Switches(Mapping[str, bool]):
    """Switches of the corrections. A switch that is not given has its default from `CORRECTIONS`.

    Raises ValueError if a key is unknown (the message gives the nearest known key) or a value is not true or
    false.
    """

    stated: Mapping[str, bool] = field(default_factory=dict)
    """Keys that were given."""

    def __post_init__(self) -> None:
        stated: dict[str, bool] = {}
        for key, value in self.stated.items():
            if not isinstance(value, bool):
                raise ValueError(f"switch '{key}' must be true or false, got {value!r}")
            if correction_key(key) in stated:
                raise ValueError(
                    f"switch '{correction_key(key)}' is stated twice, with blanks and with underscores"
                )
            stated[correction_key(key)] = value
        object.__setattr__(self, "stated", MappingProxyType(stated))

    def __getitem__(self, key: str) -> bool:
        known = correction_key(key)
        return self.stated.get(known, CORRECTIONS[known][0])

    def __iter__(self) -> Iterator[str]:
        return iter(CORRECTIONS)

    def __len__(self) -> int:
        return len(CORRECTIONS)

    def state(self, key: str) -> str:
        """Origin of a switch's value: "on by default", "switched off", ..."""
        state = "on" if self[key] else "off"
        return f"switched {state}" if correction_key(key) in self.stated else f"{state} by default"


def correction_key(key: str) -> str:
    """The switch of `CORRECTIONS` for a key. Underscores replace blanks in the key."""
    known = str(key).replace("_", " ")
    if known not in CORRECTIONS:
        near = get_close_matches(known, CORRECTIONS, n=1)
        hint = f"; did you mean '{near[0]}'? Known are" if near else "; known are"
        raise ValueError(f"no correction is called {key!r}{hint} {', '.join(map(repr, CORRECTIONS))}")
    return known


def compare(
    name: str,
    key: str,
    before: ArrayLike,
    after: ArrayLike,
    *,
    applied: bool,
    unit: str,
    reason: str,
    over: BoolArray | slice | None = None,
) -> Correction:
    """Measure the change by a correction, applied or not, over a pulse.

    Raises ValueError if the key is unknown, the shapes differ, or the reason is missing. The same error is
    raised if no sample is compared, or if a compared value is not finite.

    ``name``: name of the correction, e.g. "dispersion, incident wave". ``before``, ``after``: the signal
    without and with it, shape [n]. ``applied``: True if the result includes it. ``unit``: unit of the signal.
    ``reason``: the reason, with the values used, in one sentence. ``over``: the samples of the pulse; all of
    them by default.
    """
    key = correction_key(key)
    a, b = np.asarray(before, dtype=float), np.asarray(after, dtype=float)
    if a.shape != b.shape:
        raise ValueError(
            f"{name}: before and after have the shapes {a.shape} and {b.shape}; they must be one"
        )
    change = np.atleast_1d(b - a)[slice(None) if over is None else over]
    if not change.size:
        raise ValueError(f"{name}: there is no sample to measure the change over")
    if not np.isfinite(change).all():
        raise ValueError(f"{name}: the change is not finite at sample {np.argmin(np.isfinite(change))}")
    if not reason.strip():
        raise ValueError(f"{name}: a correction needs a reason")
    return Correction(
        name=name,
        key=key,
        applied=applied,
        size=float(np.abs(change).max()),
        rms=float(np.sqrt(np.mean(change**2))),
        unit=unit,
        reason=reason,
    )


class AuditLog:
    """Collects the corrections of one reduction in the order in which they were made.

    ``switches``: which corrections are to be applied.
    """

    def __init__(self, switches: Switches | None = None) -> None:
        self.switches = Switches() if switches is None else switches
        self._entries: list[Correction] = []

    @property
    def corrections(self) -> tuple[Correction, ...]:
        """The entries so far."""
        return tuple(self._entries)

    def add(self, *corrections: Correction) -> None:
        """Append entries that another function has measured. Raises ValueError if a key is unknown."""
        self._entries.extend([replace(entry, key=correction_key(entry.key)) for entry in corrections])

    def complete(self, reasons: Mapping[str, str]) -> None:
        """Append an entry for each correction that has none.

        It is listed as not applied, with its reason.

        Raises ValueError if a key is unknown.
        """
        there = {entry.key for entry in self._entries}
        self.add(
            *(Correction(k, k, False, 0.0, 0.0, "1", why) for k, why in reasons.items() if k not in there)
        )

    def compare(self, name: str, key: str, before: ArrayLike, after: ArrayLike, **options: Any) -> Correction:
        """Measure a change by `compare`, and append it."""
        entry = compare(name, key, before, after, **options)
        self.add(entry)
        return entry

    def choose(
        self,
        name: str,
        key: str,
        before: FloatArray,
        after: FloatArray,
        *,
        unit: str,
        reason: str,
        over: BoolArray | slice | None = None,
    ) -> FloatArray:
        """The corrected signal if its switch is on, otherwise the uncorrected one.

        In both cases the correction is listed with its size.
        """
        on = self.switches[key]
        why = f"{reason}; {self.switches.state(key)}"
        self.compare(name, key, before, after, applied=on, unit=unit, reason=why, over=over)
        return after if on else before


def table_of(corrections: Iterable[Correction]) -> dict[str, list[Any]]:
    """Corrections as the columns of a table, ready for `kolsky.base.files.write_table`."""
    rows = tuple(corrections)
    return {
        "correction": [row.name for row in rows],
        "switch": [row.key for row in rows],
        "applied": ["yes" if row.applied else "no" for row in rows],
        "largest change": [row.size for row in rows],
        "rms change": [row.rms for row in rows],
        "unit": [row.unit for row in rows],
        "reason": [row.reason for row in rows],
    }
