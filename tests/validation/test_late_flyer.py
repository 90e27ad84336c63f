"""open-01 with its flyer's record 20 us late: nothing is called identified, the clock is named."""

from dataclasses import replace
from pathlib import Path

import pytest

from kolsky.diagnosis.verdicts import leading_lag
from kolsky.identification import identify
from kolsky.inverse.forward import Numerics
from kolsky.inverse.result import Verdict
from kolsky.inverse.settings import Settings
from kolsky.shot.load import load_shot

OPEN = Path(__file__).resolve().parents[2] / "runs" / "open-01"
LATE = 20e-6


@pytest.mark.slow
@pytest.mark.parametrize("hold", [("poisson", "damping"), ()])
def test_a_late_flyer_is_named(hold: tuple[str, ...]) -> None:
    shot = load_shot(OPEN)
    late = replace(shot.flyer, time=shot.flyer.time + LATE)
    wrong = replace(shot, flyer=late, window=(shot.window[0], min(shot.window[1], float(late.time[-1]))))
    coarse = Settings(hold=hold, numerics=Numerics(mesh=(16, 22)), refined_mesh=(32, 44), replicates=16)
    found = identify(wrong, coarse)
    # The answer is withheld, and the clock is the first of the inputs that are said to be wrong.
    assert found.estimates["stiffness_factor"].outcome is Verdict.UNEXPLAINED
    first = found.causes[0]
    assert (first.key, first.named) == ("flyer.time", True)
    (said,) = [text for text in found.warnings if "lag of the flyer's record" in text]
    assert "check the times and frame numbers of flyer.file" in said
    if not hold:
        # No valley of Poisson's ratio fits, and the search ends in a wrong one, where no lag settles. From
        # the declared values, which are right, the flyer's clock explains most of the misfit; what damping
        # and stiffness still have to move is seen in it (1.3 us).
        assert abs(first.value - LATE) < 2e-6
        return
    assert abs(first.value - LATE) < 1e-6
    lag = leading_lag(found.clocks)
    assert lag is not None
    assert (lag.recording, lag.file, lag.key) == ("flyer", "flyer.csv", "flyer.frame")
    assert abs(lag.lag - LATE) < 2.0 * lag.sigma
    # On 32 x 44 elements the outline keeps a slow error of 2.8 um, which moves the lag by 1.0 us: as much as
    # it was to be known to before that error was in its uncertainty (0.6 us without). 20 us stay 13 sigma.
    assert lag.sigma < 2e-6
    others = [one for one in found.clocks if one.recording != "flyer"]
    assert not any(one.explains for one in others)
