"""A loading goes one way: where a strain turns back, and what a column without a unit may hold."""

from pathlib import Path

import numpy as np
import pytest

from kolsky.base.errors import InputError
from kolsky.material.fits.columns import Columns
from kolsky.material.fits.homogeneous_test import read_homogeneous_test, turning_point

UP = np.linspace(0.0, 0.8, 21)
COLUMNS = {"convention": "tension-positive", "strain": "strain", "stress": "stress"}


@pytest.mark.parametrize(
    ("strain", "row"),
    [
        (UP, None),
        (UP[::-1], None),
        (-UP, None),
        (np.concatenate([UP, UP[-2::-1]]), 20),
        (np.concatenate([-UP, -UP[-2::-1]]), 20),
        (np.concatenate([UP[::-1], UP[1:]]), 20),
        (np.concatenate([UP, UP[-2::-1], UP]), 20),
        (UP + 0.019 * np.cos(np.pi * np.arange(21)), None),  # goes back by less than a twentieth of 0.838
        (np.concatenate([UP[:11], [0.37, 0.375, 0.38], UP[11:]]), None),  # by 0.03, a twentieth is 0.04
        (np.concatenate([UP, UP[-2::-1], 1.2 * UP]), 20),
        (np.concatenate([-UP, UP]), None),  # a tension below a compression
    ],
)
def test_a_strain_turns_back_over_what_it_has_covered(strain: np.ndarray, row: int | None) -> None:
    assert turning_point(strain) == row


def written(folder: Path, strain: np.ndarray) -> Path:
    path = folder / "a.csv"
    rows = "\n".join(f"{e:.5f},{1e3 * e:.5f}" for e in strain)
    path.write_text(f"strain,stress (Pa)\n{rows}\n")
    return path


def test_loading_takes_the_points_up_to_the_turn(tmp_path: Path) -> None:
    path = written(tmp_path, np.concatenate([UP, UP[-2::-1]]))
    test, _ = read_homogeneous_test(path, Columns(**COLUMNS, loading=True))
    assert test.strain == pytest.approx(UP, abs=1e-5)
    with pytest.raises(InputError, match=r"turns back behind point 21, at 0.8.* --loading"):
        read_homogeneous_test(path, Columns(**COLUMNS))


def test_strains_that_may_be_per_cent_are_asked_for_their_unit(tmp_path: Path) -> None:
    path = written(tmp_path, 100.0 * UP)
    with pytest.raises(InputError, match=r"strains up to 80 without a unit, .* a stretch of 81"):
        read_homogeneous_test(path, Columns(**COLUMNS))
    assert read_homogeneous_test(path, Columns(**COLUMNS, strain_unit="%"))[0].strain.max() == 0.8
    assert read_homogeneous_test(path, Columns(**COLUMNS, strain_unit="1"))[0].strain.max() == 80.0
