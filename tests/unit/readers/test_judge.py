"""Conditions for clipped, constant or missing samples, and factors of units."""

from pathlib import Path

import numpy as np
import pytest

from kolsky.base.errors import InputError
from kolsky.readers.contents import Channel, Clock
from kolsky.readers.header import si_unit, split_unit, time_factor
from kolsky.readers.recordings import check_changing, check_finite, check_unclipped

FILE = Path("a.csv")


def channel(values: np.ndarray) -> Channel:
    clock = Clock(0.0, 1e-6, "made")
    return Channel("CH1", 2, "V", values.size, lambda: values, lambda: clock, lambda sample: sample + 2)


def refused(check, values: np.ndarray, *rest) -> str:
    with pytest.raises(InputError) as caught:
        check(FILE, channel(values), values, *rest)
    return str(caught.value)


def flat_top(top: int, *, elsewhere: int = 1, level: float = 1.0) -> np.ndarray:
    """A triangle with so many equal samples at its top, and so many at one value of its flank."""
    up = np.linspace(0.0, 0.9, 100) * level
    return np.concatenate([up[:60], np.full(elsewhere - 1, up[59]), up[60:], np.full(top, level), up[::-1]])


def test_a_sample_at_the_stated_full_scale_is_clipped() -> None:
    values = np.array([0.0, 0.5, -1.999, 0.1])
    check_unclipped(FILE, channel(values), values, "V", 2.0)
    for value in (2.0, -2.0):
        values[2] = value
        assert "a.csv line 4: channel 'CH1' is clipped" in refused(check_unclipped, values, "V", 2.0)


@pytest.mark.parametrize("level", [1.0, -1.0])
def test_eight_equal_samples_at_an_extreme_are_a_flat_top(level: float) -> None:
    check_unclipped(FILE, channel(flat_top(7)), flat_top(7, level=level), "V", None)
    said = refused(check_unclipped, flat_top(8, level=level), "V", None)
    assert "8 equal samples at its extreme" in said
    assert "line 102:" in said  # the first of them


def test_a_flat_top_is_four_times_longer_than_runs_elsewhere() -> None:
    """Coarse digits make runs of five anywhere: nineteen at the top are not clipped, twenty are."""
    check_unclipped(FILE, channel(flat_top(19)), flat_top(19, elsewhere=5), "V", None)
    assert "elsewhere at most 5" in refused(check_unclipped, flat_top(20, elsewhere=5), "V", None)


def test_a_signal_that_begins_near_an_extreme_is_quiet_there_not_clipped() -> None:
    """The beginning, its first fiftieth, is within a fifth of the range of the smallest value."""
    for begin, ok in ((0.19, True), (0.2, False)):
        pulse = np.linspace(0.3, 1.0, 100)
        values = np.concatenate([begin + 1e-3 * np.arange(4), pulse, pulse[::-1], np.zeros(12), [0.05]])
        if ok:
            check_unclipped(FILE, channel(values), values, "V", None)
        else:
            assert "12 equal samples at its extreme 0 V" in refused(check_unclipped, values, "V", None)


def test_missing_and_constant_samples() -> None:
    values = np.array([0.0, 1.0, np.nan, np.inf])
    assert "line 4: channel 'CH1' is nan, the first of 2" in refused(check_finite, values)
    assert "is 0.25 in all 5 samples" in refused(check_changing, np.full(5, 0.25))
    check_changing(FILE, channel(values), np.array([0.25, 0.25, 0.2500001]))


@pytest.mark.parametrize(
    ("text", "unit", "factor"),
    [
        ("mV", "V", 1e-3), ("Volts", "V", 1.0), ("kV", "V", 1e3), ("µs", "s", 1e-6),
        ("ns", "s", 1e-9), ("ms", "s", 1e-3),
        ("kN", "N", 1e3), ("MPa", "Pa", 1e6), ("kPa", "Pa", 1e3), ("µε", "1", 1e-6), ("mε", "1", 1e-3),
        ("microstrain", "1", 1e-6), ("%", "1", 1e-2), ("strain", "1", 1.0),
        ("[mA]", "A", 1e-3), ("pC", "C", 1e-12),
    ],
)  # fmt: skip
def test_units_as_instruments_write_them(text: str, unit: str, factor: float) -> None:
    assert si_unit(text) == (unit, factor)


def test_no_unit_is_guessed() -> None:
    assert si_unit("furlong") is None
    assert split_unit("CH1 (mV)") == ("CH1", "mV")
    assert split_unit("CH1 (left)") == ("CH1 (left)", None)
    assert time_factor(FILE, "ms", "t") == 1e-3
    with pytest.raises(InputError, match="has the unit 'mV'"):
        time_factor(FILE, "mV", "t")
