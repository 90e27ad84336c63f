"""A stored reduction is the same one; another SPEC or a damaged file is not taken for it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from kolsky.base.errors import InputError
from kolsky.bodies import actuator_control
from kolsky.bodies.actuator_control import basis_key
from kolsky.bodies.actuator_reading import ControlSection
from tests.unit.bodies.small import DOWN, MOST, actuator

SECTION = ControlSection.model_construct(
    angles=[0.02], hold=0.5, rate=20.0, gain=0.3, most=MOST, modes=4, tolerance=1e-3, snapshots=3,
    plant_stiffness=0.85, delay=1, lag=0.05, noise=0.0, seed=1, real_time=False,
)  # fmt: skip


def test_a_stored_reduction_closes_the_same_loop(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    small, gravities = actuator(chambers=1), {"down": np.array(DOWN)}
    folder = tmp_path / "kept" / "basis"  # there is none yet
    first, made = actuator_control.run_control(small, gravities, SECTION, basis=folder)
    monkeypatch.setattr(actuator_control, "reduce_actuator", None)  # it is not made again
    second, again = actuator_control.run_control(small, gravities, SECTION, basis=folder)
    assert np.array_equal(first["down"].pressure, second["down"].pressure)
    assert again["down"].largest_error == made["down"].largest_error
    (folder / "down.h5").write_bytes(b"no HDF5")
    with pytest.raises(InputError, match="delete it"):
        actuator_control.run_control(small, gravities, SECTION, basis=folder)


def test_the_key_says_what_it_follows_from() -> None:
    small = actuator(chambers=1)
    own = basis_key(small, DOWN, SECTION, 9)
    assert own == basis_key(actuator(chambers=1), DOWN, SECTION.model_copy(update={"rate": 200.0}), 9)
    others = [
        (replace(small, density=1021.0), DOWN, SECTION, 9),
        (replace(small, solid=small.solid.with_parameters(1.1 * small.solid.parameters())), DOWN, SECTION, 9),
        (actuator(chambers=1, wall=2.6e-3), DOWN, SECTION, 9),
        (small, (0.0, 0.0, 9.81), SECTION, 9),
        (small, DOWN, SECTION.model_copy(update={"plant_stiffness": 0.9}), 9),
        (small, DOWN, SECTION, 8),
    ]
    assert own not in {basis_key(*other) for other in others}
