"""A branch that the data do not ask for: values inside their ranges, and what it would take."""

from dataclasses import replace

import pytest

from kolsky.inverse.joint_result import RANGE, as_not_seen, interval, needed_strength
from kolsky.inverse.result import Estimate, Verdict

SOURCES = ("force and shape", "scatter between shots")
STRENGTH = Estimate(
    "prony_strength_1", "1", 0.004, 0.03, 0.04, 0.0, dict.fromkeys(SOURCES, 0.01), Verdict.IDENTIFIED,
    mesh_correction=-0.002, searched=(0.0, 2.0),
)  # fmt: skip
TIME = Estimate(
    "prony_time_1", "s", 1.3e-4, 2e-5, 1e-5, 3e-5, dict.fromkeys(SOURCES, 1e-5), Verdict.CONDITIONAL,
    numerical_parts={"mesh": 1e-5}, mesh_correction=1.1e-4, searched=(2e-5, 5e-3),
)  # fmt: skip


def test_a_strength_keeps_its_upper_limit_and_is_never_negative() -> None:
    found = as_not_seen(STRENGTH)
    assert found == replace(STRENGTH, outcome=Verdict.NOT_SEEN)
    assert found.sigma == pytest.approx(0.05)  # 3-4-5
    assert interval(found, 2.0 * found.sigma) == pytest.approx((0.0, 0.104))


def test_a_time_of_no_branch_is_anywhere_in_its_range() -> None:
    """No correction, and the standard deviation of a range whose values are evenly likely."""
    found = as_not_seen(TIME)
    assert found.value == pytest.approx(2e-5)  # 130 us less the correction of 110
    assert (found.mesh_correction, found.mesh_shift, found.sigma_numerical) == (0.0, 0.0, 0.0)
    assert found.sigma == pytest.approx((5e-3 - 2e-5) / 12.0**0.5)
    assert found.noise_parts == {"force and shape": 0.0, "scatter between shots": 0.0, RANGE: found.sigma}
    assert found.numerical_parts == {"mesh": 0.0}
    assert found.outcome is Verdict.NOT_SEEN
    # 20 us with a half width of 2.9 ms would have been -2.9 to 2.9 ms.
    assert interval(found, 2.0 * found.sigma) == (2e-5, 5e-3)


def test_what_does_not_relax_stays_as_it_is() -> None:
    m = replace(TIME, name="stiffness_factor", unit="1")
    assert as_not_seen(m) is m
    assert interval(m, 1e-4) == pytest.approx((3e-5, 2.3e-4))


def test_it_says_which_strength_would_be_seen() -> None:
    weak = {e.name: as_not_seen(e) for e in (STRENGTH, TIME)}
    (said,) = needed_strength(weak)
    assert "prony_strength_1 and what depends on it are not seen: it takes a strength above 0.1, 2 " in said
    assert "without one prony_time_1 has no value" in said
    assert "has no value" not in needed_strength({"prony_strength_1": weak["prony_strength_1"]})[0]
    # One that is seen, and one that something else speaks against.
    assert needed_strength({"prony_strength_1": STRENGTH, "prony_time_1": TIME}) == []
    strong = replace(weak["prony_strength_1"], value=0.11)
    assert needed_strength({"prony_strength_1": strong}) == []
