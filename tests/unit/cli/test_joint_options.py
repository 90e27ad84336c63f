"""`kolsky identify SHOT...`: what is asked for, and what is refused before any work."""

import pytest

from kolsky.base.errors import InputError
from kolsky.cli.identify_shots import JointOptions, refuse_single_shot_options
from kolsky.inverse.forward import Numerics


def options(**given: object) -> JointOptions:
    return JointOptions(**given)  # type: ignore[arg-type]


def settings(asked: JointOptions):  # type: ignore[no-untyped-def]
    return asked.settings(
        free=None,
        held={},
        hold=("damping",),
        numerics=Numerics(mesh=(12, 16)),
        refined=(24, 32),
        replicates=3,
        seed=2,
    )


def test_the_options_reach_the_settings() -> None:
    made = settings(options(curve_nodes=6, curve_roughness=0.2, gain_each="0.5 %", no_scatter=True))
    assert (made.curve_nodes, made.curve_roughness, made.scatter) == (6, 0.2, False)
    assert made.gain_each == pytest.approx(0.005)
    assert (made.hold, made.refined_mesh, made.replicates, made.seed) == (("damping",), (24, 32), 3, 2)
    assert not options().asked
    assert options(curve_nodes=4).asked


def test_values_that_cannot_be_name_the_command_line() -> None:
    with pytest.raises(InputError, match="curve_nodes must be 0 or 4 to 24, got 3"):
        settings(options(curve_nodes=3))
    with pytest.raises(InputError, match="--gain-each"):
        settings(options(gain_each="much"))


def test_what_means_something_for_one_shot_alone_is_refused() -> None:
    refuse_single_shot_options({"bayes": False, "diagnose": False})
    with pytest.raises(InputError, match="--diagnose is for one shot by itself"):
        refuse_single_shot_options({"bayes": False, "diagnose": True})
