"""Synthetic bar signals with a known answer: `python -m populations.bar_signals [--count N] [--workers N]`.

The study draws two populations of tests between bars. The thresholds were chosen on the first population and
are tested on the second. It counts offsets of the first rises relative to their sigma, and distinguished
correct and wrong distances. It also counts reported mean stresses for flow and for increasing stress, and
drifts after the baseline within their sigma. It writes `populations/results/bar_signals.json`.
`tests/validation/bars_page.py` makes a table of this file.
"""

from dataclasses import replace
from typing import Any

import numpy as np

from kolsky.bars.guides.propagation import propagation
from kolsky.bars.guides.waveguide import ElasticWaveguide
from kolsky.bars.records import BarSignal, FaceWaves, Signal
from kolsky.bars.reduction.stress_strain import reduce
from kolsky.bars.reduction.summary import LARGEST_DELAY
from kolsky.bars.reduction.validity import judge_plateau
from kolsky.bars.reduction.windows import check_windows, incident_arrival
from kolsky.bars.signals.baseline import diffusion
from kolsky.base.apparatus import Bar, Specimen
from kolsky.base.arrays import FloatArray
from populations.driver import RESULTS, command, results, write

FILE = RESULTS / "bar_signals.json"
POPULATIONS = {"chosen on": 21_000, "judged on": 143_000}
"""First seeds: the thresholds were fixed before the second population was drawn."""
STEP = 0.2e-6
BARS = {
    "steel": Bar(20e-3, 3.0, 205e9, 7850.0, 0.29),
    "aluminium": Bar(16e-3, 3.0, 71e9, 2720.0, 0.33),
    "titanium": Bar(12.7e-3, 3.0, 114e9, 4430.0, 0.32),
}
WRONG = 0.06
"""Error of a wrongly declared distance [m]."""


def band_of(bar: Bar) -> float:
    """Frequency up to which waves are propagated [Hz], as in `kolsky.bars.reduction.separation`."""
    return 0.6 * bar.wave_speed / bar.diameter


def drawn(seed: int) -> dict[str, Any]:
    """One synthetic test: strains at the faces of a specimen with a flow stress, and the records of the
    gauges."""
    rng = np.random.default_rng(seed)
    bar = BARS[str(rng.choice(list(BARS)))]
    specimen = Specimen(bar.diameter * rng.uniform(0.4, 0.8), bar.diameter * rng.uniform(0.25, 0.6), 2000.0)
    rise, hold = rng.uniform(8e-6, 40e-6), rng.uniform(60e-6, 120e-6)
    time = STEP * np.arange(2000) - 60e-6
    up, down = (np.clip((time - at) / rise, 0.0, 1.0) for at in (0.0, rise + hold))
    if rng.uniform() < 0.5:
        up, down = (0.5 * (1.0 - np.cos(np.pi * x)) for x in (up, down))
    peak = rng.uniform(0.4e-3, 1.5e-3)
    source, distances = peak * (up - down), (rng.uniform(0.9, 1.4), rng.uniform(0.4, 1.2))
    wave = Signal(float(time[0]), STEP, source, 0.0, "1")
    incident = propagation(wave, ElasticWaveguide(bar), distances[0], band=band_of(bar)).signal.value
    # Stress of the specimen over that of the incident wave: elastic up to a flow stress, then constant or
    # increasing.
    area = specimen.area / (np.pi * bar.diameter**2 / 4.0)
    flow = rng.uniform(0.1, 0.6) * peak * bar.youngs_modulus / area
    modulus = flow / rng.uniform(0.003, 0.02)
    rises = rng.uniform() < 0.5
    final = 2.0 * bar.wave_speed * peak * (hold + rise) / specimen.length
    hardening = flow / final * (rng.uniform(2.0, 6.0) if rises else rng.uniform(0.0, 0.15))
    strain, transmitted = 0.0, np.zeros(time.size)
    c, E = bar.wave_speed, bar.youngs_modulus
    for n in range(1, time.size):
        strain += 2.0 * c * (incident[n - 1] - transmitted[n - 1]) / specimen.length * STEP
        stress = min(modulus * strain, flow + hardening * strain)
        transmitted[n] = max(0.0, stress * area / E)
        if incident[n] < transmitted[n]:  # unloading: the force follows the incident wave
            transmitted[n] = max(0.0, incident[n])
    return {
        "bar": bar,
        "specimen": specimen,
        "time": time,
        "incident": incident,
        "reflected": transmitted - incident,
        "transmitted": transmitted,
        "change": float(
            np.diff(np.interp((rise + 0.2 * hold, rise + hold), time, transmitted))[0] / transmitted.max()
        ),
        "noise": peak * 10.0 ** rng.uniform(-2.7, -1.7),
        "distances": distances,
        "source": source,
        "rng": rng,
    }


def at_gauges(made: dict) -> tuple[BarSignal, BarSignal]:
    """The two gauges' strains, dispersed, with noise."""
    bar, rng = made["bar"], made["rng"]
    guide = ElasticWaveguide(bar)
    first, second = made["distances"]
    count = int((made["time"][-1] + 2.2 * first / bar.wave_speed + 2e-4) / STEP) + 2500
    start = made["time"][0] - 1.5 * first / bar.wave_speed

    def seen(name: str, distance: float) -> FloatArray:
        wave = Signal(float(made["time"][0]), STEP, np.pad(made[name], (0, 500)), 0.0, "1")
        return propagation(wave, guide, distance, band=band_of(bar), start=start, samples=count).signal.value

    clock = start + STEP * np.arange(count) + first / bar.wave_speed
    incident = np.interp(clock, made["time"], made["source"])
    strains = (incident + seen("reflected", first), seen("transmitted", second))
    return tuple(
        BarSignal(
            Signal(
                start,
                STEP,
                s + made["noise"] * rng.standard_normal(count),
                made["noise"],
                "1",
                f"{side} gauge",
            ),
            bar,
            distance,
            side,
        )
        for s, distance, side in zip(strains, (first, second), ("incident", "transmission"), strict=True)
    )  # type: ignore[return-value]


def arrivals(seed: int) -> dict[str, float]:
    """Offsets over their sigmas: with correct distances, and with a gauge declared too far or too near by
    `WRONG`."""
    first, second = at_gauges(drawn(seed))
    found = {}
    for name, by in (("right", 0.0), ("far", WRONG), ("near", -WRONG)):
        reflected, _ = check_windows(replace(first, position=first.position + by), second)
        _, transmitted = check_windows(first, replace(second, position=second.position + by))
        for wave, check in (("reflected", reflected), ("transmitted", transmitted)):
            found[f"{wave}, {name}"] = float(check.offset / check.offset_sigma)
    rise = incident_arrival(first).rise_time
    found["scatter"] = float(check_windows(first, second)[0].offset / rise)
    return found


def plateaus(seed: int) -> dict[str, float]:
    """Whether a mean stress is reported, and the change of the true stress along the pulse."""
    made = drawn(seed)
    names = ("incident", "reflected", "transmitted")
    rng, noise = made["rng"], made["noise"]
    waves = {name: made[name] + noise * rng.standard_normal(made["time"].size) for name in names}
    sigma = dict.fromkeys(names, noise)
    faces = FaceWaves(
        made["time"], **waves, sigma=sigma, incident_bar=made["bar"], transmission_bar=made["bar"]
    )
    reduction = reduce(faces, made["specimen"])
    found = judge_plateau(reduction, faces)
    return {"change": made["change"], "quoted": float(found.stress_fault is None and found.span is not None)}


def drifts(seed: int) -> dict[str, float]:
    """Error of the zero two baseline lengths after the baseline, over its sigma, for three kinds of drift."""
    rng = np.random.default_rng(seed)
    n, found = 500, {}
    whole = 3 * n
    for kind in ("none", "walk", "steady"):
        size = 10.0 ** rng.uniform(-1.5, 1.0)
        drift = {
            "none": np.zeros(whole),
            "walk": size * np.cumsum(rng.standard_normal(whole)) / np.sqrt(n),
            "steady": size * np.arange(whole) / n,
        }[kind]
        value = drift[:n] + rng.standard_normal(n)
        strength = diffusion(value, 1.0, sigma=1.0, memory=1.0)
        sigma = np.sqrt(1.0 / n + strength * (n / 3.0 + 2.0 * n))
        found[kind] = float((drift[-1] - value.mean()) / sigma)
        found[f"sigma, {kind}"] = float(sigma)
    return found


def one(seed: int) -> dict[str, Any]:
    """Results of all three checks for one seed."""
    return {"seed": seed, "arrivals": arrivals(seed), "plateaus": plateaus(seed), "drifts": drifts(seed)}


def counted(rows: list[dict[str, Any]]) -> dict[str, float]:
    """Numbers of the table for one population."""

    def column(part: str, name: str) -> FloatArray:
        return np.array([row[part][name] for row in rows])

    scatter = column("arrivals", "scatter")
    table = {
        "tests": float(len(rows)),
        "first rise of the reflected pulse, mean offset over the rise": float(np.nanmean(scatter)),
        "its standard deviation over the rise": float(np.nanstd(scatter)),
    }
    for wave, sides in (("reflected", 2), ("transmitted", 1)):
        for name in ("right", "far", "near"):
            ratio = column("arrivals", f"{wave}, {name}")
            beyond = ratio < -LARGEST_DELAY if sides == 1 else np.abs(ratio) > LARGEST_DELAY
            table[f"{wave} pulse remarked, distance {name}"] = float(beyond.mean())
    change, quoted = column("plateaus", "change"), column("plateaus", "quoted")
    table["mean stress quoted, its change along the pulse below 20 %"] = float(
        quoted[np.abs(change) < 0.2].mean()
    )
    table["mean stress quoted, its change along the pulse above 45 %"] = float(
        quoted[np.abs(change) > 0.45].mean()
    )
    for kind in ("none", "walk", "steady"):
        table[f"zero within two sigmas two baselines later, drift: {kind}"] = float(
            (np.abs(column("drifts", kind)) < 2.0).mean()
        )
    return table


def main() -> None:
    """Draw both populations and write the counts to the file."""
    parser = command(__doc__, out=False)
    parser.add_argument("--count", type=int, default=120)
    given = parser.parse_args()
    found = {}
    for name, first in POPULATIONS.items():
        seeds = [(seed,) for seed in range(first, first + given.count)]
        found[name] = counted(sorted(results(one, seeds, given.workers), key=lambda row: row["seed"]))
    write(FILE, found, indent=1)
    for key in found["chosen on"]:
        print(f"{key:70} " + " ".join(f"{table[key]:10.4g}" for table in found.values()))


if __name__ == "__main__":
    main()
