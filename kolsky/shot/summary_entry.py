"""One line of a shot's summary: a named value with its unit."""

from dataclasses import dataclass

_WRITTEN = {"1": ("um/m", 1e6), "m": ("mm", 1e3), "s": ("us", 1e6), "Pa": ("kPa", 1e-3)}


@dataclass(frozen=True)
class Entry:
    """One line of the summary."""

    section: str
    """The table of the shot file it belongs to."""
    name: str
    """What it is."""
    value: float | int | str
    """Its value, SI."""
    unit: str = ""
    """SI unit; empty for counts, ratios and words."""

    def written(self) -> str:
        """The value in the units of a laboratory, e.g. "9.5 mm"."""
        if isinstance(self.value, str):
            return self.value
        unit, factor = _WRITTEN.get(self.unit, (self.unit, 1.0))
        if self.unit == "m" and 0.0 < abs(self.value) < 1e-4:
            unit, factor = "um", 1e6
        if self.unit == "Pa" and abs(self.value) >= 1e9:
            unit, factor = "GPa", 1e-9
        return f"{self.value * factor:.6g} {unit}".strip()
