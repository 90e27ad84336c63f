"""What the choice between elastic and relaxing says, and when it says that it was not made."""

from kolsky.joint.model_choice import sentence


def test_a_search_that_ended_above_a_model_that_it_contains_decides_nothing() -> None:
    said = sentence(666.0, 0.3, asked=False, missed=664.0)
    assert said.startswith("not decided")
    assert "ended 664 in -2 ln L above" in said


def test_the_choice_otherwise() -> None:
    assert sentence(-8.0, 1e-4, asked=True).startswith("the data ask for what relaxes (AIC -8.0; 0.01 %")
    assert sentence(2.0, 0.3, asked=False).startswith("the data do not ask for what relaxes (AIC +2.0; 30 %")
