"""The tables of shot.toml about bars and gauges: [bars], [recorders], [gauges], [waves], [uncertainty]."""

from typing import Annotated, Literal

from pydantic import ConfigDict, Field, model_validator

from kolsky import shotfields as f
from kolsky.shotsection import Section


class WaveBarSection(Section):
    """[bars.incident] or [bars.transmission]: a round bar, by its modulus or by its measured wave speed."""

    diameter: f.Length
    length: f.Length
    density: f.Density
    poisson: f.Poisson
    youngs_modulus: f.Modulus | None = None
    wave_speed: f.Velocity | None = None

    @model_validator(mode="after")
    def _one_stiffness(self) -> "WaveBarSection":
        if (self.youngs_modulus is None) == (self.wave_speed is None):
            raise f.problem(
                "is missing" if self.wave_speed is None else "is given beside youngs_modulus",
                key="wave_speed",
                cure='give either wave_speed = "5188 m/s" (E follows from it and the density) or '
                'youngs_modulus = "210 GPa"',
            )
        return self

    @property
    def modulus(self) -> float:
        """Young's modulus [Pa], from the wave speed where that is given."""
        if self.youngs_modulus is not None:
            return self.youngs_modulus
        assert self.wave_speed is not None  # the validator saw to it
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
    balance: f.Share = 0.05
    corrections: dict[str, bool] = {}

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


class UncertaintySection(Section):
    """[uncertainty]: standard uncertainties (k = 1); what is not given counts as exact."""

    bar_modulus: f.Uncertainty = 0.0
    bar_density: f.Uncertainty = 0.0
    bar_diameter: f.Uncertainty = 0.0
    gauge_calibration: f.Uncertainty = 0.0
    gauge_distance: f.Offset = 0.0
    specimen_diameter: f.Uncertainty = 0.0
    specimen_length: f.Uncertainty = 0.0


class GaugeSection(Section):
    """[gauges.NAME]: strain gauges at one place of a bar; two channels are opposed gauges."""

    recorder: f.Name
    channels: Annotated[list[f.Name], Field(min_length=1, max_length=2)]
    bar: Literal["incident", "transmission"]
    distance: f.Length
    compression: Literal["positive", "negative"]
    signal: Literal["volts", "strain"] = "volts"
    strain_per_volt: f.StrainPerVolt | None = None
    baseline: f.Interval
    full_scale: f.Voltage | None = None

    @model_validator(mode="after")
    def _one_calibration(self) -> "GaugeSection":
        if self.signal == "volts" and self.strain_per_volt is None:
            raise f.problem(
                "is missing; the signal is in volts",
                key="strain_per_volt",
                cure='add e.g. strain_per_volt = "0.0005 1/V", or signal = "strain"',
            )
        return self


class WavesShotFile(Section):
    """A shot.toml for `kolsky waves`: bars and gauges are needed, what `identify` reads is left alone."""

    model_config = ConfigDict(extra="ignore", frozen=True, strict=True)

    format: Literal[1]
    name: f.Name | None = None
    specimen: SpecimenSection
    bars: BarsSection
    recorders: Annotated[dict[str, RecorderSection], Field(min_length=1)]
    gauges: Annotated[dict[str, GaugeSection], Field(min_length=2)]
    waves: WavesSection = WavesSection()
    uncertainty: UncertaintySection = UncertaintySection()
