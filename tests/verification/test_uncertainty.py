"""Budgets, draws and repeated tests; figures and tolerances as on the page (`uncertainty.py`)."""

import pytest
import uncertainty as topic


@pytest.mark.slow  # 15 s
def test_printed_examples_of_the_gum() -> None:
    result = topic.case()
    for example in result.budgeted:
        assert example.digits < topic.PRINTED, example
    for example in result.drawn:
        assert example.off < topic.DRAWN, example
    assert result.wide > 0.2  # the GUM's 19.9 against 17.0: 0.28 u


@pytest.mark.slow
def test_budget_of_a_bar_test_is_that_of_draws() -> None:
    result = topic.case()
    assert topic.sigma_off(result) < topic.DRAWN
    for name, (found, exact) in topic.closed_form(result).items():
        assert found == pytest.approx(exact, rel=topic.CLOSED), name
    assert result.budget.nonlinearity("stress") < 0.02


@pytest.mark.slow
def test_intervals_of_repeated_tests_hold_the_truth() -> None:
    assert topic.shares_off(topic.case()) < topic.HELD
