"""Baselines that end after their gauge's pulse begins are refused, each by its own arrival."""

from types import SimpleNamespace

import pytest
from elastic_layer import Layer

from kolsky.bars.reduction.windows import check_baselines

SCENE = Layer()
"""Steel bars; time 0 when the wave meets the specimen; gauges 0.75 m before it and 0.5 m behind."""
FIRST = -0.75 / SCENE.first.wave_speed
SECOND = 0.5 / SCENE.second.wave_speed


def test_baselines_end_before_their_pulse():
    """The first rise is 5 % of a flank of 20 us after the foot: 1 us."""
    signals = SCENE.signals(noise=1e-6)

    def checked(incident, transmission):
        ends = {"incident": FIRST + incident, "transmission": SECOND + transmission}
        stations = {side: SimpleNamespace(baseline=(-1e-3, end)) for side, end in ends.items()}
        check_baselines(SimpleNamespace(stations=stations), *signals)

    checked(0.5e-6, 0.5e-6)
    with pytest.raises(
        ValueError, match=r"incident gauge: the baseline ends .* Cure: end the baseline before"
    ):
        checked(2e-6, 0.0)
    with pytest.raises(ValueError, match=r"transmission gauge: the baseline ends"):
        checked(0.0, 2e-6)
