"""What shots share does not average out of their mean, and what is each one's own does."""

from dataclasses import replace

import numpy as np
import pytest
from ratedshots import rated

from kolsky.studies.rates.comparison import compare
from kolsky.studies.rates.records import RatedShot

M = "stiffness_factor"


def shot(number: int, *, shift: float, roughness: float = 0.0) -> RatedShot:
    """A shot whose mesh was corrected, with 0.003 of its own and 0.002 of mesh and element left."""
    one = rated(f"shot-{number}", 1.12, 100.0 * (1 + number), own=0.003)
    estimate = replace(
        one.found.estimates[M],
        noise_parts={"force and shape": 0.003},
        numerical_parts={"mesh": 0.002, "roughness": roughness},
        sigma_numerical=float(np.hypot(0.002, roughness)),
        mesh_shift=shift,
    )
    return replace(one, found=replace(one.found, estimates={M: estimate}))


def test_the_mesh_does_not_average_whichever_way_each_was_corrected() -> None:
    shots = [shot(i, shift=0.005 * (-1.0) ** i) for i in range(4)]
    pooled = compare(shots).groups[0].pooled
    assert pooled is not None
    assert pooled.sigma_common == pytest.approx(0.002, rel=1e-12)
    # Four alike, of 0.003 each: their scatter is zero, and the mean has half of it beside the mesh.
    assert pooled.sigma == pytest.approx(np.hypot(0.003 / 2.0, 0.002), rel=1e-9)


def test_roughness_is_each_shots_own() -> None:
    assert shot(0, shift=-0.005, roughness=0.004).sigma_own == pytest.approx(0.005)  # 3, 4, 5
    pooled = compare([shot(i, shift=-0.005, roughness=0.004) for i in range(4)]).groups[0].pooled
    assert pooled is not None
    assert pooled.sigma == pytest.approx(np.hypot(0.005 / 2.0, 0.002), rel=1e-9)
