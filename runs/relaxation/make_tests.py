"""Make the slow tests of this folder: `python runs/relaxation/make_tests.py`.

The solid has a long-term E = 80 kPa and two branches: 12 % at 10 ms and 6 % at 30 s. The first tests are
three holds of 1000 s at 15, 30 and 50 % compression after ramps of 0.1 s, with 1 % of noise. The other test
is oscillation from 5 to 45 °C with the reference 25 °C, C1 = 8.86 and C2 = 101.6 K, with 0.2 % of noise.
"""

from pathlib import Path

import numpy as np

from explicit.materials import neo_hookean
from explicit.relaxation import PronySeries, prony_stress
from kolsky.material.relaxation.temperature import wlf

HERE = Path(__file__).resolve().parent
YOUNG, SERIES = 80e3, PronySeries((0.12, 0.06), (0.01, 30.0))


def main() -> None:
    """Write the tables."""
    rng = np.random.default_rng(11)
    law = neo_hookean(YOUNG / 3.0)
    for strain in (15, 30, 50):
        time = np.concatenate([np.linspace(0.0, 0.1, 21), 0.1 + np.geomspace(0.01, 1000.0, 50)])
        stretch = 1.0 - 0.01 * strain * np.minimum(time / 0.1, 1.0)
        stress = -1e-3 * prony_stress(law, SERIES, time, stretch) * (1.0 + 0.01 * rng.standard_normal(71))
        write(
            f"hold_{strain}.csv", "time (s),strain (%),stress (kPa)", [time, 100.0 * (1.0 - stretch), stress]
        )
    levels, omega = np.array([5.0, 15.0, 25.0, 35.0, 45.0]), np.geomspace(0.04, 70.0, 12)
    T, omega = (grid.ravel() for grid in np.meshgrid(levels, omega, indexing="ij"))
    reduced = omega * 10.0 ** wlf(T - 25.0, 8.86, 101.6)
    storage = YOUNG * SERIES.storage(reduced) * (1.0 + 0.002 * rng.standard_normal(T.size))
    loss = YOUNG * SERIES.loss(reduced) + 40.0 * rng.standard_normal(T.size)
    write(
        "sweep.csv",
        "T (degC),f (Hz),E storage (kPa),E loss (kPa)",
        [T, omega / (2.0 * np.pi), 1e-3 * storage, 1e-3 * loss],
    )


def write(name: str, head: str, columns: list[np.ndarray]) -> None:
    """Write a table with six digits."""
    np.savetxt(HERE / name, np.column_stack(columns), delimiter=",", header=head, comments="", fmt="%.6g")


if __name__ == "__main__":
    main()
