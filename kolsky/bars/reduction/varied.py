"""The apparatus as quantities of a budget, and the same with other values of them."""

from collections.abc import Mapping
from dataclasses import replace

from kolsky.bars.records import Quantity
from kolsky.base.apparatus import Bar, Specimen


def bar_quantities(bar: Bar, side: str, uncertainty: Mapping[str, float]) -> list[Quantity]:
    """What a bar contributes: modulus or measured wave speed, density, diameter, Poisson's ratio.

    With an uncertainty of the wave speed, that is the quantity; the modulus follows from it and the density.

    Parameters
    ----------
    bar
        The bar.
    side
        "incident" or "transmission".
    uncertainty
        Standard uncertainties by key: "bar_modulus" or "bar_wave_speed", "bar_density", "bar_diameter"
        relative, "bar_poisson" absolute; 0 if absent.
    """

    def relative(words: str, value: float, key: str, unit: str) -> Quantity:
        return Quantity(f"{side} bar, {words}", value, value * uncertainty.get(key, 0.0), unit, "B")

    if uncertainty.get("bar_wave_speed", 0.0) > 0.0:
        stiffness = relative("wave speed", bar.wave_speed, "bar_wave_speed", "m/s")
    else:
        stiffness = relative("Young's modulus", bar.youngs_modulus, "bar_modulus", "Pa")
    return [
        stiffness,
        relative("density", bar.density, "bar_density", "kg/m^3"),
        relative("diameter", bar.diameter, "bar_diameter", "m"),
        Quantity(f"{side} bar, Poisson's ratio", bar.poisson, uncertainty.get("bar_poisson", 0.0), "1", "B"),
    ]


def length_quantities(
    specimen: Specimen, positions: Mapping[str, float], uncertainty: Mapping[str, float]
) -> list[Quantity]:
    """The specimen's sizes and the gauges' distances.

    Parameters
    ----------
    specimen
        The specimen.
    positions
        Distance of each gauge by side [m].
    uncertainty
        "specimen_diameter" and "specimen_length" relative, "gauge_distance" in metres.
    """
    d, L = specimen.diameter, specimen.length
    return [
        Quantity("specimen, diameter", d, d * uncertainty.get("specimen_diameter", 0.0), "m", "B"),
        Quantity("specimen, length", L, L * uncertainty.get("specimen_length", 0.0), "m", "B"),
        *(
            Quantity(f"{side} gauge, distance", x, uncertainty.get("gauge_distance", 0.0), "m", "B")
            for side, x in positions.items()
        ),
    ]


def varied_bar(bar: Bar, side: str, values: Mapping[str, float]) -> Bar:
    """The bar with other values of its `bar_quantities`, by name."""
    density = values.get(f"{side} bar, density", bar.density)
    modulus = values.get(f"{side} bar, Young's modulus", bar.youngs_modulus)
    speed = values.get(f"{side} bar, wave speed")
    return replace(
        bar,
        youngs_modulus=modulus if speed is None else density * speed**2,
        density=density,
        diameter=values.get(f"{side} bar, diameter", bar.diameter),
        poisson=values.get(f"{side} bar, Poisson's ratio", bar.poisson),
    )


def varied_specimen(specimen: Specimen, values: Mapping[str, float]) -> Specimen:
    """The specimen with other values of its `length_quantities`."""
    return replace(
        specimen,
        diameter=values.get("specimen, diameter", specimen.diameter),
        length=values.get("specimen, length", specimen.length),
    )


def varied_position(position: float, side: str, values: Mapping[str, float]) -> float:
    """A gauge's distance with another value."""
    return values.get(f"{side} gauge, distance", position)
