"""The validity window of synthetic tests with known reasons."""

import numpy as np
import pytest

from kolsky.bars.records import History
from kolsky.bars.reduction.validity import Reason, validity

AREA = 7e-5
STEP = np.arange(400)
T = 1e-6 * STEP


def case(front, back, added=0.0, noise=0.01):
    sigma = np.full(T.size, noise)
    strain = History(T / T[-1] * 0.5, np.full(T.size, 1e-4), "1")
    return {
        "front_force": History(front + 0.0 * T, sigma, "N"),
        "back_force": History(back + 0.0 * T, sigma, "N"),
        "strain": strain,
        "inertial_stress": (added + 0.0 * T) / AREA,
        "area": AREA,
    }


def test_the_window_ends_where_the_faces_differ_and_begins_where_inertia_fades():
    front = np.where(STEP < 300, 100.0, 110.0)
    added = np.where(STEP < 80, 20.0, 1.0)
    found = validity(T, **case(front, np.full(T.size, 100.0), added))
    assert found.window == pytest.approx((80e-6, 299e-6))
    assert (found.start_reason, found.end_reason) == (Reason.INERTIA, Reason.BALANCE)
    assert found.covered == pytest.approx(219 / 399)
    assert not found.nearly_empty
    assert "inverse method" not in found.sentence
    assert "80.0 us to 299.0 us" in found.sentence
    assert found.counts[Reason.INERTIA] == pytest.approx(80 / 400)


def test_the_share_is_the_users():
    """Forces 8 % apart are out at 5 % and in at 10 %."""
    assert validity(T, **case(104.0, 96.0)).window is None
    found = validity(T, **case(104.0, 96.0), share=0.1)
    assert found.window == pytest.approx((0.0, T[-1]))
    assert found.start_reason is Reason.RECORD
    assert found.end_reason is Reason.RECORD


def test_no_time_counts_and_the_message_says_what_to_do():
    found = validity(T, **case(130.0, 70.0))
    assert found.window is None
    assert found.start_reason is Reason.BALANCE
    assert found.nearly_empty
    assert "kolsky identify" in found.sentence


def test_noise_is_told_from_imbalance_and_averaged_away():
    """2 N of noise on 50 N hide 5 %; over 20 samples they do not."""
    rng = np.random.default_rng(0)
    front, back = (50.0 + 2.0 * rng.standard_normal(T.size) for _ in range(2))
    single = validity(T, **case(front, back, noise=2.0))
    # Two sigmas are left out by 4.6 % of pairs of samples; the rest is the noise's.
    assert single.counts[Reason.BALANCE] < 0.09
    assert single.counts[Reason.NOISE] > 0.9
    averaged = validity(T, **case(front, back, noise=2.0), average=20e-6)
    # 2 N sqrt(2) / sqrt(20) = 0.63 N, 1.3 % of the stress: three intervals in a thousand miss 5 %.
    assert averaged.covered > 0.9


def test_pulling_faces_are_not_valid():
    found = validity(T, **case(-10.0, -10.0))
    assert found.window is None
    assert found.counts[Reason.VALID] == 0.0


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"share": 1.0}, "share in"),
        ({"area": 0.0}, "area must be > 0"),
        ({"average": 1.0}, "at least 3 are needed"),
        ({"inertial_stress": np.zeros(3)}, "one value at each of 400 times"),
    ],
)
def test_impossible_options(change, words):
    with pytest.raises(ValueError, match=words):
        validity(T, **{**case(1.0, 1.0), **change})
