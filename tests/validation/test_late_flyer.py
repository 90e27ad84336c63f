"""open-01 with its flyer's record 20 us late: nothing is called identified, the clock is named."""

from pathlib import Path

import pytest

from kolsky.diagnosis.fit_quality import leading_lag
from kolsky.identification import identify
from kolsky.inverse.forward import Numerics
from kolsky.inverse.problem import Settings
from kolsky.inverse.result import Verdict
from kolsky.shot.load import load_shot
from populations.answers import late_flyer

OPEN = Path(__file__).resolve().parents[2] / "runs" / "open-01"
LATE = 20e-6


@pytest.mark.slow
@pytest.mark.parametrize("hold", [("poisson", "damping"), ()])
def test_a_late_flyer_is_named(hold: tuple[str, ...]) -> None:
    wrong = late_flyer(load_shot(OPEN), LATE)
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
        # the declared values, which are right, the flyer's clock explains most of the misfit, and what is
        # free follows it on the refined mesh. On 32 x 44 elements that is right within 1 us.
        assert abs(first.value - LATE) < 1e-6
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


@pytest.mark.slow
def test_of_three_free_parameters_on_default_meshes_too_the_flyer_is_first() -> None:
    """Both clocks that move the outline start in a valley of Poisson's ratio where its own explains more.

    The flyer's clock explains the force too, in the valley where the ringing is in step (about 2 min).
    """
    found = identify(late_flyer(load_shot(OPEN), LATE))
    assert {e.outcome for e in found.estimates.values()} == {Verdict.UNEXPLAINED}
    first, second = found.causes[:2]
    assert (first.key, first.named) == ("flyer.time", True)
    assert first.alike == ()
    # The outline's clock leaves the force's misfit; nothing is likely beside the flyer's.
    assert first.evidence > second.evidence + 100.0
    assert not any(one.named for one in found.causes if one.beside)
    # Its sigma of 0.16 us is that of the answer's residual; on the refined mesh 20.19 us were found.
    assert abs(first.value - LATE) < 0.5e-6
    assert abs(first.parameters["stiffness_factor"] - 1.12) < 0.01
    assert abs(first.parameters["poisson"] - 0.499) < 1e-5
