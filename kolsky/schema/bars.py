"""The tables of shot.toml about bars and gauges: [bars], [recorders], [gauges], [waves]."""

from difflib import get_close_matches
from typing import Annotated, Literal

from pydantic import ConfigDict, Field, field_validator, model_validator

from kolsky.bars.audit import CORRECTIONS
from kolsky.schema import fields as f
from kolsky.schema.apparatus import SpecimenSection, UncertaintySection
from kolsky.schema.fields import LayoutSection, Section


class PronySection(Section):
    """[bars.NAME.prony]: the complex modulus of a polymer bar, a spring and Maxwell elements."""

    long_term: f.Modulus
    moduli: Annotated[list[f.Modulus], Field(min_length=1, max_length=50)]
    times: Annotated[list[f.PositiveTime], Field(min_length=1, max_length=50)]

    @model_validator(mode="after")
    def _one_time_each(self) -> "PronySection":
        self.alike(("times",), "moduli", "give one relaxation time for each modulus")
        return self


class WaveBarSection(Section):
    """[bars.incident] or [bars.transmission]: a round bar with its modulus, wave speed or Prony series."""

    diameter: f.Length
    length: f.Length
    density: f.Density
    poisson: f.Poisson
    youngs_modulus: f.Modulus | None = None
    wave_speed: f.Velocity | None = None
    prony: PronySection | None = None
    yield_strength: f.Modulus | None = None

    @model_validator(mode="after")
    def _one_stiffness(self) -> "WaveBarSection":
        self.exactly_one(
            ("wave_speed", "youngs_modulus", "prony"),
            'give one of wave_speed = "5188 m/s" (E follows from it and the density), '
            'youngs_modulus = "210 GPa" and, for a polymer, a table prony',
        )
        return self

    @property
    def modulus(self) -> float:
        """Young's modulus [Pa], by the wave speed if declared, or by the fastest wave of a Prony series."""
        if self.prony is not None:
            return self.prony.long_term + sum(self.prony.moduli)
        if self.youngs_modulus is not None:
            return self.youngs_modulus
        assert self.wave_speed is not None  # checked by the validator
        return self.density * self.wave_speed**2


class BarsSection(Section):
    """[bars]: both bars."""

    incident: WaveBarSection
    transmission: WaveBarSection


class WavesSection(Section):
    """[waves]: how the signals are reduced."""

    load: Literal["compression", "tension"] = "compression"
    incident: f.Interval | None = None
    reflected: f.Interval | None = None
    transmitted: f.Interval | None = None
    analysis: Literal["one wave", "two waves", "three waves"] = "three waves"
    balance: f.Share = 0.05
    plateau: f.Share = 0.3
    share: f.Share = 0.05
    corrections: dict[str, bool] = Field(default_factory=dict)

    @field_validator("corrections")
    @classmethod
    def _known_corrections(cls, corrections: dict[str, bool]) -> dict[str, bool]:
        for key in corrections:
            if key not in CORRECTIONS:
                near = get_close_matches(key, CORRECTIONS, n=1)
                raise f.problem(
                    f"has no correction {key!r}; there are {', '.join(CORRECTIONS)}",
                    cure=f"did you mean {near[0]!r}?" if near else "remove it",
                )
        return corrections

    @model_validator(mode="after")
    def _all_windows_or_none(self) -> "WavesSection":
        given = {key: getattr(self, key) for key in ("incident", "reflected", "transmitted")}
        missing = [key for key, window in given.items() if window is None]
        if 0 < len(missing) < len(given):
            raise f.problem(
                "is missing; the other windows are given",
                key=missing[0],
                cure="give all three windows, or none of them to have the pulses found",
            )
        return self


class RecorderSection(LayoutSection):
    """[recorders.NAME]: a file of a recorder, its format, and its clock."""

    file: f.FileName
    clock_offset: f.Time


class ShuntSection(Section):
    """[gauges.NAME.bridge.shunt]: a known resistance across one arm, and the recorded step."""

    resistance: f.Resistance
    step: f.SignedVoltage
    arm: Annotated[int, Field(ge=1, le=4)] = 1
    at_gauge: bool = False
    resistance_sigma: f.LeadResistance = 0.0


class BridgeSection(Section):
    """[gauges.NAME.bridge]: a Wheatstone bridge with its supply and amplifier."""

    kind: Literal["quarter", "half, opposed", "half, Poisson", "full, Poisson"]
    gauge_factor: f.Number
    excitation: f.Voltage
    gain: f.Number = 1.0
    gauge_resistance: f.Resistance = 120.0
    lead_resistance: f.LeadResistance = 0.0
    shunt: ShuntSection | None = None


Sign = Literal["positive", "negative"]
"""Sign of a gauge's signal under compression."""


class ReflectedSection(Section):
    """[gauges.incident.reflected]: the reflected pulse of the same gauge in a separate column."""

    channel: f.Name | Annotated[int, Field(ge=1)]
    start: f.PositiveTime | None = None
    """Time added to the column's times to convert them to the recorder's clock."""


class GaugeSection(Section):
    """[gauges.incident] or [gauges.transmission]: a strain gauge, or two on opposite sides of the bar."""

    recorder: f.Name | Annotated[list[f.Name], Field(min_length=2, max_length=2)]
    channels: Annotated[list[f.Name | Annotated[int, Field(ge=1)]], Field(min_length=1, max_length=2)]
    distance: f.Length
    compression: Sign | Annotated[list[Sign], Field(min_length=2, max_length=2)]
    strain_per_volt: f.StrainPerVolt | None = None
    bridge: BridgeSection | None = None
    strain: Literal[True] | None = None
    baseline: f.Interval
    full_scale: f.Voltage | None = None
    reflected: ReflectedSection | None = None

    @property
    def recorders(self) -> list[str]:
        """The recorder of each channel."""
        return self.recorder if isinstance(self.recorder, list) else [self.recorder] * len(self.channels)

    @property
    def signs(self) -> tuple[int, ...]:
        """+1 for each channel in which compression is positive, -1 for the others."""
        same = [self.compression] * len(self.channels)
        stated = self.compression if isinstance(self.compression, list) else same
        return tuple(1 if sign == "positive" else -1 for sign in stated)

    @model_validator(mode="after")
    def _one_calibration_and_as_many_as_channels(self) -> "GaugeSection":
        if len(self.channels) > 1:
            self.without(
                ("reflected",), "two channels are opposed gauges", "average them before the pulses are cut"
            )
        self.alike(
            ("recorder", "compression"),
            "channels",
            "give one for both channels, or one for each of two opposed gauges",
        )
        self.exactly_one(
            ("strain_per_volt", "bridge", "strain"),
            'give one of strain_per_volt = "0.0005 1/V", a table bridge, or strain = true where the '
            "file holds strain already",
        )
        return self


class GaugesSection(Section):
    """[gauges]: one station on each bar.

    A second station on the incident bar, farther from the specimen, separates overlapping pulses.
    """

    incident: GaugeSection
    incident_far: GaugeSection | None = None
    transmission: GaugeSection

    @model_validator(mode="after")
    def _cut_pulses_of_the_incident_bar(self) -> "GaugesSection":
        for key in ("incident_far", "transmission"):
            station = getattr(self, key)
            if station is not None and station.reflected is not None:
                raise f.problem(
                    "is given, but only [gauges.incident] has a reflected pulse",
                    key=f"{key}.reflected",
                    cure="remove it; a transmitted pulse is placed by its recorder's clock_offset",
                )
        return self


class BarsShotFile(Section):
    """A shot.toml for `kolsky wavespeed`: bars and gauges, no specimen between them."""

    model_config = ConfigDict(extra="ignore", frozen=True, strict=True)

    format: Literal[1]
    name: f.Name | None = None
    bars: BarsSection
    recorders: Annotated[dict[str, RecorderSection], Field(min_length=1)]
    gauges: GaugesSection
    waves: WavesSection = WavesSection()
    uncertainty: UncertaintySection = UncertaintySection()


class WavesShotFile(BarsShotFile):
    """A shot.toml for `kolsky waves`. Bars and gauges are required; tables of `identify` are ignored."""

    specimen: SpecimenSection
