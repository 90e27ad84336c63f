"""Write tek0017.csv: a synthetic test between bars with a known answer, in the format of an oscilloscope.

Steel bars carry their first mode. The specimen is always in equilibrium. Its nominal stress is 120 MPa (1 -
exp(-strain / 0.02)). Each gauge has noise of 2 um/m. Signals are rounded to a thousandth of a millivolt.
`python runs/bar-01/make_raw.py` writes an identical file.
"""

from pathlib import Path

import numpy as np

from kolsky.bars.guides.propagation import propagation
from kolsky.bars.guides.waveguide import ElasticWaveguide
from kolsky.bars.records import Signal
from kolsky.base.apparatus import Bar, Specimen

BAR = Bar(diameter=20e-3, length=2.0, youngs_modulus=8000.0 * 5000.0**2, density=8000.0, poisson=0.29)
SPECIMEN = Specimen(diameter=10e-3, length=5e-3, density=1200.0)
INTERVAL, SAMPLES, START = 2e-7, 4000, -200e-6
FLOW, GROWTH = 120e6, 0.02
ARRIVAL = 200e-6
"""Of the incident wave at the specimen, on the scope's clock [s]."""
STIFFNESS = BAR.impedance * BAR.wave_speed
"""E A of a bar [N]."""
GAUGES = {"incident": 1.0, "transmission": 0.5}
MICROSTRAIN_PER_MILLIVOLT = 2.0
"""Both bridges. Compression gives negative volts."""
SEED = 17


def waves() -> tuple[np.ndarray, ...]:
    """Times from the arrival, and incident, reflected and transmitted strain at the specimen, shape [n]."""
    t = INTERVAL * np.arange(1500)
    rise, fall = np.clip(t / 25e-6, 0.0, 1.0), np.clip((150e-6 - t) / 25e-6, 0.0, 1.0)
    incident = 0.9e-3 * np.sin(0.5 * np.pi * rise) ** 2 * np.sin(0.5 * np.pi * fall) ** 2
    transmitted, strain = np.zeros(t.size), 0.0
    for k in range(1, t.size):
        stress = FLOW * (1.0 - np.exp(-strain / GROWTH)) if incident[k] > 0.0 else 0.0
        transmitted[k] = min(stress * SPECIMEN.area / STIFFNESS, incident[k])
        strain += INTERVAL * 2.0 * BAR.wave_speed * (incident[k] - transmitted[k]) / SPECIMEN.length
    return t, incident, transmitted - incident, transmitted


def at_gauge(wave: np.ndarray, distance: float) -> np.ndarray:
    """The signal of a wave at a gauge, later than at the face (or earlier if negative), shape [SAMPLES]."""
    quiet = np.zeros(500)
    signal = Signal(ARRIVAL - 500 * INTERVAL, INTERVAL, np.concatenate([quiet, wave, quiet]), 0.0, "1")
    guide = ElasticWaveguide(BAR)
    way = propagation(signal, guide, distance, band=150e3, start=START, samples=SAMPLES)
    return way.signal.value


FILE = Path(__file__).with_name("tek0017.csv")


def main(path: Path = FILE) -> None:
    """Write the file; by default next to this script."""
    _, incident, reflected, transmitted = waves()
    near = GAUGES["incident"]
    strains = [
        at_gauge(incident, -near) + at_gauge(reflected, near),
        at_gauge(transmitted, GAUGES["transmission"]),
    ]
    rng = np.random.default_rng(SEED)
    volts = [-(s + 2e-6 * rng.standard_normal(SAMPLES)) * 1e6 / MICROSTRAIN_PER_MILLIVOLT for s in strains]
    head = [
        "Model,MSO44",
        f"Sample Interval,{INTERVAL:.1E},s",
        f"Record Length,{SAMPLES},",
        "Label,INPUT BAR,OUTPUT BAR",
        "TIME,CH1 (mV),CH2 (mV)",
    ]
    time = START + INTERVAL * np.arange(SAMPLES)
    rows = [f"{t:.4E},{a:.3f},{b:.3f}" for t, a, b in zip(time, *volts, strict=True)]
    path.write_text("\n".join([*head, *rows]) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
