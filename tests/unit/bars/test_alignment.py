"""Fine alignment for records whose pulses arrive later than distance and wave speed predict."""

from types import SimpleNamespace

import numpy as np
import pytest
from barshots import STRESS, bar_shot

from kolsky.bars.audit import Switches
from kolsky.bars.records import BarSignal, Signal
from kolsky.bars.reduction.windows import Alignment, alignments, delays
from kolsky.base.apparatus import Bar
from kolsky.shot.waves import waves

BAR = Bar(diameter=0.02, length=2.0, youngs_modulus=200e9, density=8000.0)


def station(side: str, position: float) -> BarSignal:
    return BarSignal(Signal(0.0, 1e-7, np.zeros(4), 0.0, "1"), BAR, position, side)


def test_an_aligned_wave_stays_where_it_was_seen():
    """A gauge 5 mm farther than declared predicts 2 us more; the aligned wave does not follow."""
    aligned = {
        "reflected": Alignment("reflected", 3e-6, 400e-6, 0.2e-6),
        "transmitted": Alignment("transmitted", -1e-6, 300e-6, 0.3e-6),
    }
    assert delays({}, station("incident", 1.0), station("transmission", 0.5), {}) == (0.0, 0.0)
    as_declared = delays(aligned, station("incident", 1.0), station("transmission", 0.5), {})
    assert as_declared == pytest.approx((3e-6, -1e-6), abs=1e-15)
    farther = delays(aligned, station("incident", 1.005), station("transmission", 0.5), {})
    assert farther == pytest.approx((1e-6, -2e-6), abs=1e-15)
    moved = delays(
        aligned,
        station("incident", 1.0),
        station("transmission", 0.5),
        {"alignment, reflected wave": 0.2e-6},
    )
    assert moved == pytest.approx((3.2e-6, -1e-6), abs=1e-15)


def check(delay: float | None, sigma: float = 0.4e-6):
    seen = None if delay is None else SimpleNamespace(sigma=sigma, time=500e-6 + delay)
    return SimpleNamespace(predicted=500e-6, observed=seen, delay=delay, reason="nothing there")


def test_the_uncertainty_is_that_of_both_arrivals():
    arrival = SimpleNamespace(time=100e-6, sigma=0.3e-6)
    found, missing = alignments(arrival, (check(2e-6), check(None)), Switches())
    assert found["reflected"].sigma == pytest.approx(0.5e-6)
    assert (found["reflected"].late, found["reflected"].way) == (2e-6, pytest.approx(400e-6))
    assert missing == {"transmitted": "no transmitted pulse is found: nothing there"}
    with pytest.raises(ValueError, match="transmitted wave cannot be aligned"):
        alignments(arrival, (check(2e-6), check(None)), Switches({"transmitted alignment": True}))


def test_a_wrong_distance_is_aligned_away(tmp_path):
    """The incident gauge is declared 10 mm too near: its reflection comes 4 us late."""

    def run(name: str, corrections: str):
        folder = bar_shot(tmp_path / name, corrections=f"punching = false{corrections}")
        text = (folder / "shot.toml").read_text()
        (folder / "shot.toml").write_text(text.replace('"1000 mm"', '"990 mm"'))
        return waves(folder)

    off = run("off", "")
    on = run("on", ', "reflected alignment" = true, "transmitted alignment" = true')
    log = {c.name: c for c in off.corrections}
    entry = log["alignment, reflected wave"]
    assert not entry.applied
    assert "observed +4" in entry.reason
    # 4 us of a flank of 1500 (1 - 0.208) um/m in 20 us.
    assert entry.size == pytest.approx(4.0 / 20.0 * 1.5e-3 * (1.0 - 0.2083), rel=0.1)
    assert {c.name: c for c in on.corrections}["alignment, reflected wave"].applied
    first, second = ((r.front_force, r.back_force) for r in (off.reduction, on.reduction))
    # Bars of 62.8 MN: on the flanks the forces differ by what is misaligned, and no longer.
    apart = [np.abs(a.value - b.value)[: int(140e-6 / 1e-7)].max() for a, b in (first, second)]
    assert apart[1] < 0.35 * apart[0]
    assert on.budget.results["peak stress"][0] == pytest.approx(STRESS, rel=0.03)
    names = {row.quantity.name for row in on.budget.contributions}
    assert {"alignment, reflected wave", "alignment, transmitted wave"} < names
