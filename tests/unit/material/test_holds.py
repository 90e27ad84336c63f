"""Constant strains after a ramp: the end of the ramp, messages, and the data of the reference curve."""

from pathlib import Path

import numpy as np
import pytest

from kolsky.base.errors import InputError
from kolsky.material.fits.columns import Columns
from kolsky.material.fits.homogeneous_test import read_homogeneous_test, turning_point
from kolsky.material.reference_curve import Treatment, reference_curve
from kolsky.material.uniaxial import UniaxialTest, divide_ramp_and_hold, loading_ramps, remarks_of


def record(*, held=1000.0, noise=0.0, timed=True, seed=4):
    """A ramp to 20 % in 10 s, stress 100 kPa times strain, then a hold in which it falls to 0.8."""
    rng = np.random.default_rng(seed)
    ramp, hold = np.linspace(0.0, 10.0, 101), 10.0 + np.linspace(0.0, held, 201)[1:]
    time = np.concatenate([ramp, hold])
    strain = np.minimum(0.02 * time, 0.2) + np.where(time > 10.0, noise * rng.standard_normal(time.size), 0.0)
    stress = 1e5 * np.minimum(0.02 * time, 0.2) * np.where(time > 10.0, 0.8 + 0.2 * np.exp(10.0 - time), 1.0)
    return UniaxialTest("s1", strain, stress, compression=True, time=time if timed else None)


@pytest.mark.parametrize("noise", [0.0, 3e-4])
def test_a_ramp_ends_where_its_strain_is_reached(noise):
    test = record(noise=noise)
    ramp, hold = divide_ramp_and_hold(test, loading_ramps(test)[0])
    # 0.5 % of the range before the end is reached at 9.95 s: the sample of 10.0 s, or with noise one beside.
    assert 99 <= ramp.stop - 1 <= 101
    assert hold is not None
    assert hold.duration == pytest.approx(1000.0, abs=0.2)
    assert hold.first == pytest.approx(2e4, rel=0.01)
    assert hold.last == pytest.approx(1.6e4)
    (said,) = remarks_of("s1", hold)
    assert "for 1000 s and the stress goes from 20 to 16 kPa" in said
    assert "kolsky material relaxation" in said


def test_a_steady_ramp_holds_nothing():
    time = np.linspace(0.0, 10.0, 1001)
    test = UniaxialTest("s1", 0.02 * time, 1e3 * time, compression=True, time=time)
    ramp, hold = divide_ramp_and_hold(test, slice(0, 1001))
    assert hold is None
    assert ramp == slice(0, 1001)


@pytest.mark.parametrize(("held", "found"), [(0.4, False), (0.6, True)])
def test_a_hold_is_five_per_cent_of_the_ramp(held, found):
    """Of 10 s; the ramp ends at its sample of 10 s."""
    assert (divide_ramp_and_hold(record(held=held), slice(0, 101))[1] is not None) is found


def test_without_times_samples_count():
    _, hold = divide_ramp_and_hold(record(timed=False), slice(0, 101))
    assert hold is not None
    assert hold.duration is None
    assert hold.samples == 201
    assert "for 201 samples" in remarks_of("s1", hold)[0]


def test_a_hold_without_relaxation_is_not_told():
    _, hold = divide_ramp_and_hold(record(), slice(0, 101))
    assert hold is not None
    for last, told in ((0.995, 0), (0.985, 1)):
        assert len(remarks_of("s1", type(hold)(0.2, 1.0, 9, 100.0, 100.0 * last))) == told
    assert remarks_of("s1", None) == ()


def test_a_reference_curve_leaves_the_hold_out_and_says_so():
    made = reference_curve([record(noise=3e-4)], Treatment(points=20))
    # Linear to the end: relaxed samples would bend its last point down by up to 20 %.
    np.testing.assert_allclose(made.band.stress, 1e5 * made.band.strain, rtol=5e-3)
    assert any("its strain is held at 0.2" in said for said in made.remarks)


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
