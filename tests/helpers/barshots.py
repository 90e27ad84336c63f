"""Shots between bars in the form of a laboratory's folder: raw files of recorders and a shot.toml.

The specimen has a closed form: the incident strain is a trapezoid, and the transmitted strain is proportional
to it. The bars have a diameter of 20 mm, a wave speed of 5000 m/s and no Poisson effect. The gauges are 1000
mm and 500 mm from the specimen; the sampling rate is 10 MHz.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

INTERVAL = 1e-7
STRESS, DIAMETER, LENGTH = 250e6, 10e-3, 5e-3
INCIDENT, SHARE = 1.5e-3, STRESS * 0.25 / 1.5e-3 / 200e9
"""Height of the incident strain, and ratio of the transmitted to the incident strain."""
RATE = 2.0 * 5000.0 * INCIDENT * (1.0 - SHARE) / LENGTH
ARRIVAL = 200e-6  # time of the wave at the incident gauge on the file's clock
TOML = """format = 1
[specimen]
diameter = "10 mm"
length = "5 mm"
density = "{density} kg/m^3"
[bars.incident]
diameter = "20 mm"
length = "2000 mm"
density = "8000 kg/m^3"
wave_speed = "5000 m/s"
poisson = 0.0
[bars.transmission]
diameter = "20 mm"
length = "2000 mm"
density = "8000 kg/m^3"
wave_speed = "5000 m/s"
poisson = 0.0
{recorders}
[gauges.incident]
{incident}
distance = "1000 mm"
baseline = {baseline}
[gauges.transmission]
{transmission}
distance = "500 mm"
baseline = {baseline}
[waves]
corrections = {{ {corrections} }}
{waves}
[uncertainty]
specimen_diameter = "1 %"
{more}
"""
ONE = """[recorders.scope]
file = "scope.csv"
clock_offset = "0 us"
"""


def ramp(t: np.ndarray, end: float = 150e-6) -> np.ndarray:
    """A trapezoid from time 0 with flanks of 20 us."""
    return np.clip(t / 20e-6, 0.0, 1.0) * np.clip((end - t) / 20e-6, 0.0, 1.0)


def strains(
    *,
    noise: float = 1e-6,
    samples: int = 8000,
    every: int = 1,
    seed: int = 7,
    late: float = 0.0,
    shift: float = 0.0,
    soft: float = 0.0,
) -> tuple[np.ndarray, ...]:
    """Times [s] and strains at the incident and the transmission gauge, compression positive, shape [n].

    ``late``, ``shift``: delay of the reflected and the transmitted pulse [s]. ``soft``: share by which the
    transmitted strain falls within 100 us after its rise.
    """
    t = INTERVAL * every * np.arange(samples // every)
    first = INCIDENT * (ramp(t - ARRIVAL) - (1.0 - SHARE) * ramp(t - ARRIVAL - 400e-6 - late))
    falls = 1.0 - soft * np.clip((t - ARRIVAL - 320e-6) / 100e-6, 0.0, 1.0)
    second = INCIDENT * SHARE * ramp(t - ARRIVAL - 300e-6 - shift) * falls
    rng = np.random.default_rng(seed)
    return t, first + noise * rng.standard_normal(t.size), second + noise * rng.standard_normal(t.size)


def write_scope(path: Path, names: list[str], columns: list[np.ndarray], *, preamble: str = "") -> Path:
    """A CSV file with commas and decimal points."""
    head = preamble + ",".join(names)
    rows = np.column_stack(columns)
    np.savetxt(path, rows, delimiter=",", header=head, comments="", fmt="%.9e", encoding="utf-8")
    return path


def bar_shot(
    folder: Path,
    *,
    columns: tuple[np.ndarray, ...] | None = None,
    names: Sequence[str] = ("inc (V)", "tra (V)"),
    factor: float = 1e3,
    **parts: object,
) -> Path:
    """A shot folder with scope.csv in volts, 1000 µm/m a volt, and its shot.toml.

    ``columns``: times and strains; those of `strains` by default. ``names``, ``factor``: of the two channels,
    and of their strains. ``parts``: of `write_toml`.
    """
    folder.mkdir(exist_ok=True, parents=True)
    t, first, second = columns or strains()
    write_scope(folder / "scope.csv", ["t (s)", *names], [t, factor * first, factor * second])
    stations = {"incident": gauge(names[0]), "transmission": gauge(names[1])}
    write_toml(folder, **{"recorders": ONE, "corrections": "punching = false", **stations, **parts})
    return folder


def gauge(channel: str, *, recorder: str = "scope") -> str:
    """A station of one channel."""
    return (
        f'recorder = "{recorder}"\nchannels = ["{channel}"]\ncompression = "positive"\n'
        'strain_per_volt = "0.001 1/V"'
    )


def write_toml(folder: Path, **parts: object) -> Path:
    """The shot.toml of a folder. Arguments that are left out add nothing."""
    said = dict.fromkeys(("recorders", "incident", "transmission", "corrections", "waves", "more"), "")
    said |= {"density": "1200", "baseline": '["0 us", "80 us"]'}
    path = folder / "shot.toml"
    path.write_text(TOML.format(**{**said, **parts}), encoding="utf-8")
    return path
