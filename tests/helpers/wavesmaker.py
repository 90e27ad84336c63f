"""A synthetic reduction for tests of files, figures and pages, with consistent shapes, not physical."""

import numpy as np

from kolsky.bars import records
from kolsky.base.apparatus import Bar, Specimen

BAR = Bar(diameter=0.02, length=2.0, youngs_modulus=210e9, density=7800.0)


def made_result(name: str = "made up", *, balanced: bool = True) -> records.WavesResult:
    """Trapezoid pulses in a steel bar and a specimen that yields."""
    interval, n = 0.2e-6, 4000
    t = interval * np.arange(n)

    def pulse(start: float, height: float) -> np.ndarray:
        x = np.clip((t - start) / 20e-6, 0.0, 1.0) * np.clip((start + 150e-6 - t) / 20e-6, 0.0, 1.0)
        return height * x

    noise = np.random.default_rng(1).normal(0.0, 4e-6, (2, n))
    seen = pulse(100e-6, 1e-3) + pulse(500e-6, -0.7e-3) + noise[0]
    incident = records.Signal(0.0, interval, seen, 4e-6, "1", "incident")
    transmitted = records.Signal(0.0, interval, pulse(440e-6, 0.3e-3) + noise[1], 4e-6, "1", "transmission")
    m = 800
    time = interval * np.arange(m)
    shape = pulse(5e-6, 1.0)[:m]
    rate = 900.0 * shape
    strain = np.cumsum(rate) * interval
    stress = 180e6 * shape

    def history(values: np.ndarray, relative: float, unit: str) -> records.History:
        return records.History(values, relative * np.abs(values) + 1e-3 * np.abs(values).max(), unit)

    ways = ("one wave", "two waves", "three waves")
    reduction = records.Reduction(
        time=time,
        strain={w: history(strain * f, 0.01, "1") for w, f in zip(ways, (0.98, 1.01, 1.0), strict=True)},
        rate={w: history(rate * f, 0.01, "1/s") for w, f in zip(ways, (0.98, 1.01, 1.0), strict=True)},
        stress={w: history(stress * f, 0.02, "Pa") for w, f in zip(ways, (0.97, 1.02, 1.0), strict=True)},
        front_force=history(stress * 78e-6 * 1.03, 0.02, "N"),
        back_force=history(stress * 78e-6, 0.02, "N"),
        front_velocity=history(8.0 * shape, 0.01, "m/s"),
        back_velocity=history(1.0 * shape, 0.01, "m/s"),
        imbalance=np.where(shape > 0.01, 0.03 + 0.5 * np.exp(-time / 15e-6), np.inf),
        balanced=(55e-6, 150e-6) if balanced else None,
    )
    modulus = records.Quantity("bars, Young's modulus", 210e9, 1e9, "Pa", "B")
    return records.WavesResult(
        name=name,
        specimen=Specimen(diameter=0.01, length=0.004, density=1200.0),
        load="compression",
        incident=records.BarSignal(incident, BAR, 1.0, "incident"),
        transmission=records.BarSignal(transmitted, BAR, 0.7, "transmission"),
        windows=records.Windows((95e-6, 260e-6), (495e-6, 660e-6), (435e-6, 600e-6), "arrival"),
        faces=records.FaceWaves(
            time=time,
            incident=1e-3 * shape,
            reflected=-0.7e-3 * shape,
            transmitted=0.3e-3 * shape,
            sigma={"incident": 4e-6, "reflected": 4e-6, "transmitted": 4e-6},
            incident_bar=BAR,
            transmission_bar=BAR,
        ),
        reduction=reduction,
        corrections=(
            records.Correction("dispersion, incident wave", "dispersion", True, 4e-5, 1e-5, "1", "nu = 0.29"),
            records.Correction(
                "punching", "punching", False, 2e-6, 1e-6, "m", "switched off in the shot file"
            ),
        ),
        budget=records.BudgetTable(
            results={"peak stress": (180e6, 2e6, "Pa"), "largest strain": (0.11, 0.001, "1")},
            contributions=(records.Contribution(modulus, {"peak stress": 0.9, "largest strain": 0.2}),),
        ),
        facts={"wave speed, incident bar": (BAR.wave_speed, "m/s"), "sample interval": (interval, "s")},
        remarks=() if balanced else ("the forces are never balanced; use `kolsky identify`",),
        inputs={"scope.csv": "0" * 64},
        settings={"kolsky": "0"},
    )
