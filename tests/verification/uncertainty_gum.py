"""Printed examples of the GUM (JCGM 100:2008) and of its Supplement 1 (JCGM 101:2008)."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from monte_carlo import difference, monte_carlo

from kolsky.bars.budget import Budget, propagate
from kolsky.bars.records import Quantity


def quantity(name: str, value: float, sigma: float, freedom: float = np.inf, unit: str = "1") -> Quantity:
    return Quantity(name, value, sigma, unit, "B", freedom)


END_GAUGE = (
    # JCGM 100:2008, H.1, lengths in nm, temperatures in degrees Celsius.
    quantity("standard", 50.000623e6, 25.0, 18.0),
    quantity("difference", 215.0, 9.7, 25.6),
    quantity("expansion", 11.5e-6, 1.2e-6),
    quantity("temperature", -0.1, 0.41),
    quantity("expansion difference", 0.0, 0.58e-6, 50.0),
    quantity("temperature difference", 0.0, 0.029, 2.0),
)


def end_gauge(v: Mapping[str, float], rng: object = None) -> dict[str, float]:
    """Length of the end gauge, Eq. (H.3) of the GUM, expanded [nm]."""
    grown = v["expansion difference"] * v["temperature"] + v["expansion"] * v["temperature difference"]
    return {"length": v["standard"] + v["difference"] - v["standard"] * grown}


OBSERVED = np.array(
    [
        [5.007, 4.994, 5.005, 4.990, 4.999],
        [19.663e-3, 19.639e-3, 19.640e-3, 19.685e-3, 19.678e-3],
        [1.0456, 1.0438, 1.0468, 1.0428, 1.0433],
    ]
)
"""JCGM 100:2008, table H.2: voltage [V], current [A], phase [rad]."""


def impedance(v: Mapping[str, float]) -> dict[str, float]:
    """Resistance, reactance and their hypotenuse [ohm]."""
    Z = v["V"] / v["I"]
    return {"R": Z * np.cos(v["phase"]), "X": Z * np.sin(v["phase"]), "Z": Z}


def impedance_budget() -> Budget:
    """GUM H.2 from its observations."""
    mean, sigma = OBSERVED.mean(axis=1), OBSERVED.std(axis=1, ddof=1) / np.sqrt(OBSERVED.shape[1])
    names, r = ("V", "I", "phase"), np.corrcoef(OBSERVED)
    inputs = [quantity(n, m, s, 4.0) for n, m, s in zip(names, mean, sigma, strict=True)]
    pairs = {(names[i], names[j]): float(r[i, j]) for i, j in ((0, 1), (0, 2), (1, 2))}
    return propagate(impedance, inputs, correlations=pairs)


def total(v: Mapping[str, float], rng: object = None) -> dict[str, float]:
    """The sum of JCGM 101, 9.2."""
    return {"Y": sum(v.values())}


@dataclass(frozen=True)
class Example:
    """A printed number and what was computed."""

    where: str
    """Clause."""
    what: str
    """In words."""
    printed: str
    """As printed."""
    computed: float
    """By this package."""

    @property
    def off(self) -> float:
        """Relative difference."""
        return abs(self.computed / float(self.printed) - 1.0)

    @property
    def digits(self) -> float:
        """Difference in units of the last printed digit."""
        decimals = len(self.printed.partition(".")[2])
        return abs(self.computed - float(self.printed)) * 10.0**decimals


def by_sensitivities() -> tuple[Example, ...]:
    """GUM H.1 and H.2."""
    gauge, Z = propagate(end_gauge, END_GAUGE), impedance_budget()
    found = [
        Example("GUM H.1", "u_c of the length [nm]", "32", float(gauge.sigma("length"))),
        Example("GUM H.1", "effective degrees of freedom", "16", float(np.floor(gauge.freedom("length")))),
        Example("GUM H.1", "t_99", "2.92", float(gauge.coverage_factor("length", 0.99))),
    ]
    for name, value, u in (("R", "127.732", "0.071"), ("X", "219.847", "0.295"), ("Z", "254.260", "0.236")):
        found.append(Example("GUM H.2", f"{name} [ohm]", value, float(Z.value[name])))
        found.append(Example("GUM H.2", f"u_c of {name} [ohm]", u, float(Z.sigma(name))))
    for a, b, printed in (("R", "X", "-0.588"), ("R", "Z", "-0.485"), ("X", "Z", "0.993")):
        r = float(Z.covariance(a, b) / (Z.sigma(a) * Z.sigma(b)))
        found.append(Example("GUM H.2", f"correlation of {a} and {b}", printed, r))
    return tuple(found)


def by_draws(rng: np.random.Generator) -> tuple[tuple[Example, ...], float]:
    """GUM H.1.7, JCGM 101 9.2 and 9.4; how far the GUM's interval is off in 9.2.4, over u."""
    normal = dict.fromkeys((q.name for q in END_GAUGE), "normal")
    second = monte_carlo(end_gauge, END_GAUGE, trials=20_000, rng=rng, distributions=normal)["length"]
    found = [Example("GUM H.1.7", "u_c with the second order [nm]", "34", float(second.sigma))]
    for clause, last, kind, u, end in (
        ("9.2.2", 1.0, "normal", "2.0", "3.92"),
        ("9.2.3", 1.0, "rectangular", "2.0", "3.88"),
        ("9.2.4", 10.0, "rectangular", "10.1", "17.0"),
    ):
        inputs = [
            quantity(name, 0.0, sigma) for name, sigma in zip("abcd", (1.0, 1.0, 1.0, last), strict=True)
        ]
        kinds = dict.fromkeys("abcd", kind)
        spread = monte_carlo(total, inputs, trials=40_000, rng=rng, distributions=kinds)["Y"]
        found.append(Example(f"JCGM 101, {clause}", "u(y)", u, float(spread.sigma)))
        found.append(Example(f"JCGM 101, {clause}", "end of the 95 % interval", end, float(spread.high)))
        off = difference(propagate(total, inputs), "Y", spread)
    inputs = [quantity("a", 0.010, 0.005), quantity("b", 0.0, 0.005)]
    lost = monte_carlo(lost_power, inputs, trials=40_000, rng=rng)["y"]
    found.append(Example("JCGM 101, 9.4", "power loss, mean [1e-6]", "150", float(lost.mean)))
    found.append(Example("JCGM 101, 9.4", "power loss, u [1e-6]", "112", float(lost.sigma)))
    return tuple(found), off


def lost_power(v: Mapping[str, float], rng: object = None) -> dict[str, float]:
    """JCGM 101, 9.4 [1e-6]."""
    return {"y": 1e6 * (v["a"] ** 2 + v["b"] ** 2)}
