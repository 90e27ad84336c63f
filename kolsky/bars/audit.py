"""The audit log: every correction with its switch, its size and its reason, even if it was not applied."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np

from dic.basics import check_interval
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
class Switches:
    """Switches of the corrections. A switch that is not given has its default from `CORRECTIONS`.

    Raises ValueError if a key is unknown or a value is not true or false.
    """

    stated: Mapping[str, bool] = field(default_factory=dict)
    """Switches that were given, by the keys of `CORRECTIONS`."""

    def __post_init__(self) -> None:
        for key, value in self.stated.items():
            if key not in CORRECTIONS:
                raise ValueError(f"no correction is called {key!r}; known are {', '.join(CORRECTIONS)}")
            if not isinstance(value, bool):
                raise ValueError(f"switch {key!r} must be true or false, got {value!r}")

    def __getitem__(self, key: str) -> bool:
        return self.stated.get(key, CORRECTIONS[key][0])

    def state(self, key: str) -> str:
        """Origin of a switch's value: "on by default", "switched off", ..."""
        state = "on" if self[key] else "off"
        return f"switched {state}" if key in self.stated else f"{state} by default"


def correction_of(
    name: str, key: str, change: FloatArray, *, applied: bool, unit: str, reason: str
) -> Correction:
    """The entry for a correction, applied or not, with the size of the change, shape [n], in `unit`.

    ``name``: name of the correction, e.g. "dispersion, incident wave". ``key``: its switch in `CORRECTIONS`.
    ``reason``: the reason, with the values used, in one sentence. Raises ValueError if a change is not
    finite.
    """
    check_interval("(-inf, inf)", **{name: change})
    size = float(np.abs(change).max(initial=0.0))
    rms = float(np.sqrt(np.mean(change**2))) if change.size else 0.0
    return Correction(name, key, applied, size, rms, unit, reason)


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
        """Append entries that another function has measured."""
        self._entries.extend(corrections)

    def complete(self, reasons: Mapping[str, str]) -> None:
        """Append an entry for each correction that has none. It is listed as not applied, with its reason."""
        there = {entry.key for entry in self._entries}
        self.add(
            *(Correction(k, k, False, 0.0, 0.0, "1", why) for k, why in reasons.items() if k not in there)
        )

    def compare(
        self,
        name: str,
        key: str,
        before: FloatArray,
        after: FloatArray,
        *,
        applied: bool,
        unit: str,
        reason: str,
        over: BoolArray | slice = slice(None),
    ) -> None:
        """Append the change by a correction, see `correction_of`. ``over``: the samples of the pulse."""
        self.add(correction_of(name, key, (after - before)[over], applied=applied, unit=unit, reason=reason))

    def choose(
        self,
        name: str,
        key: str,
        before: FloatArray,
        after: FloatArray,
        *,
        unit: str,
        reason: str,
        over: BoolArray | slice = slice(None),
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
