"""The trends of Mates et al. (2012) on a known-answer shot: sign and rough size, on coarse meshes.

Meshes of 16 x 22 and 24 x 32 shift m by about 1 % (verification manual); the trends are ten times larger.
"""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from doe import Box, from_points
from kolsky.identification import identify
from kolsky.inverse.forward import Numerics
from kolsky.inverse.problem import Settings
from kolsky.inverse.result import Identification
from kolsky.shot.load import load_shot
from kolsky.studies.sweep import sweep

SHOT = Path(__file__).resolve().parents[2] / "runs" / "open-01"
COARSE = Numerics(mesh=(16, 22))


@cache
def held(**values: float) -> Identification:
    settings = Settings(
        free={"stiffness_factor": None}, held=values, numerics=COARSE, refined_mesh=(24, 32), replicates=0
    )
    return identify(load_shot(SHOT), settings)


def m(result: Identification) -> float:
    return result.estimates["stiffness_factor"].value


def test_more_damping_lowers_the_identified_stiffness():
    change = m(held(damping=1e-4)) / m(held()) - 1.0
    # The paper's Tables 2 and 3: 1.05 -> 0.91, so -13 % for the same step of beta from 2.5e-5 to 1e-4 s.
    assert -0.20 < change < -0.06


def test_compressibility_worsens_the_shape():
    soft, stiff = held(poisson=0.49).terms.phi_shape, held(poisson=0.499).terms.phi_shape
    # The paper's Fig. 7: Phi_S falls all the way to nu = 0.4999. The shot was made with 0.499.
    assert soft > 3.0 * stiff


def test_friction_hardly_matters_above_one_half():
    friction = np.array([0.0, 0.3, 0.5, 1.0, 2.0])
    design = from_points(
        Box.of({"friction": (0.0, 2.0), "stiffness_factor": (1.0, 1.3)}),
        np.column_stack([friction, np.full(len(friction), 1.12)]),
    )
    table = sweep(load_shot(SHOT), design, numerics=COARSE).table
    assert set(table.outcomes) == {"COMPLETED"}
    shape = dict(zip(friction, table.phi_shape, strict=True))
    force = dict(zip(friction, table.phi_force, strict=True))
    # The paper's Fig. 9: strong below 0.3 (force) and 0.5 (shape), flat above.
    assert shape[0.0] - shape[0.5] > 4.0 * abs(shape[0.5] - shape[2.0])
    assert force[0.0] - force[0.5] > 4.0 * abs(force[0.5] - force[2.0])


def test_an_unknown_parameter_is_refused_before_any_run():
    with pytest.raises(ValueError, match="there is no parameter 'stiffness'"):
        identify(load_shot(SHOT), Settings(free={"stiffness": None}))
