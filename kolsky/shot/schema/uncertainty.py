"""The table [uncertainty] of shot.toml: standard uncertainties (k = 1) of what else is declared."""

from pydantic import model_validator

from kolsky.shot.schema import fields as f
from kolsky.shot.schema.section import Section

IDENTIFIED = (
    "poisson",
    "damping",
    "friction",
    "curve_scale",
    "specimen_diameter",
    "specimen_length",
    "specimen_density",
    "sensitivity",
    "clock_offset",
    "Z_offset",
    "y_offset",
)
"""Keys that `kolsky identify` carries to its answer, in the order of its report."""
UNITS = {"damping": "s", "clock_offset": "s", "Z_offset": "m", "y_offset": "m"}
"""SI units of the keys in `IDENTIFIED` that are neither relative nor plain numbers."""
REDUCED = (
    "bar_wave_speed",
    "bar_modulus",
    "bar_density",
    "bar_diameter",
    "bar_poisson",
    "gauge_calibration",
    "gauge_distance",
    "specimen_diameter",
    "specimen_length",
    "specimen_density",
)
"""Keys that `kolsky waves` carries to the values of a test between bars."""
_IDENTIFIED_ONLY = {
    "poisson",
    "damping",
    "friction",
    "curve_scale",
    "clock_offset",
    "Z_offset",
    "y_offset",
    "length_in_pictures",
}


class UncertaintySection(Section):
    """[uncertainty]: standard uncertainties (k = 1); what is not given counts as exact."""

    bar_modulus: f.Uncertainty = 0.0
    bar_wave_speed: f.Uncertainty = 0.0
    bar_density: f.Uncertainty = 0.0
    bar_diameter: f.Uncertainty = 0.0
    bar_poisson: f.Deviation = 0.0
    bars_alike: bool = False
    gauge_calibration: f.Uncertainty = 0.0
    gauge_distance: f.LengthDeviation = 0.0
    specimen_diameter: f.Uncertainty = 0.0
    specimen_length: f.Uncertainty = 0.0
    specimen_density: f.Uncertainty = 0.0
    sensitivity: f.Uncertainty = 0.0
    mass: f.Uncertainty = 0.0
    poisson: f.Deviation = 0.0
    damping: f.TimeDeviation = 0.0
    friction: f.Friction = 0.0
    curve_scale: f.Uncertainty = 0.0
    clock_offset: f.TimeDeviation = 0.0
    Z_offset: f.LengthDeviation = 0.0
    y_offset: f.LengthDeviation = 0.0
    length_in_pictures: f.LengthDeviation = 0.0

    @model_validator(mode="after")
    def _one_stiffness(self) -> "UncertaintySection":
        if self.bar_modulus > 0.0 and self.bar_wave_speed > 0.0:
            raise f.problem(
                "is given beside bar_modulus; with the density each follows from the other",
                key="bar_wave_speed",
                cure="keep the one that was measured",
            )
        return self

    def for_waves(self) -> dict[str, float | bool]:
        """Uncertainties for the reduction of waves."""
        return self.model_dump(exclude=_IDENTIFIED_ONLY)

    def for_identify(self) -> dict[str, float]:
        """Declared uncertainties of the keys in `IDENTIFIED`; a key that is absent was not declared."""
        return {key: getattr(self, key) for key in IDENTIFIED if key in self.model_fields_set}
