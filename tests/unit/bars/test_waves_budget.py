"""Budgets and draws against closed forms; printed examples are in the verification manual."""

import numpy as np
import pytest
from monte_carlo import monte_carlo

from kolsky.bars.budget import budget_table, merge_quantities, propagate
from kolsky.bars.records import Quantity
from kolsky.bars.signals.baseline import Noise


def q(name, value, sigma, freedom=np.inf, kind="B"):
    return Quantity(name, value, sigma, "1", kind, freedom)


FOUR = [q(name, 0.0, 1.0) for name in "abcd"]


def total(v, rng=None):
    return {"Y": sum(v.values())}


def test_supplement_1_loss_is_beyond_a_straight_line():
    # JCGM 101:2008, 9.4, table 6: X1^2 + X2^2 at 0.010 and 0, u = 0.005: GUM 100e-6 +- 100e-6, true 150, 112.
    inputs = [q("X1", 0.010, 0.005), q("X2", 0.0, 0.005)]
    budget = propagate(lambda v: {"loss": v["X1"] ** 2 + v["X2"] ** 2}, inputs)
    assert budget.value["loss"] == pytest.approx(100e-6)
    assert budget.sigma("loss") == pytest.approx(100e-6)
    np.testing.assert_allclose(budget.curvature["loss"], 25e-6, rtol=1e-9)  # u^2 of each: the missing 50e-6
    assert budget.nonlinearity("loss") == pytest.approx(0.25)
    spread = monte_carlo(
        lambda v, rng: {"loss": v["X1"] ** 2 + v["X2"] ** 2},
        inputs,
        trials=20_000,
        rng=np.random.default_rng(4),
    )["loss"]
    assert spread.mean == pytest.approx(150e-6, rel=0.022)  # four of 112 / sqrt(20 000)
    assert spread.sigma == pytest.approx(112e-6, rel=0.04)  # 0.5 % and more, as the tail is long


def test_histories_sample_by_sample():
    t = np.linspace(0.0, 1.0, 11)
    inputs = [q("a", 3.0, 0.1, 10.0), q("b", -2.0, 0.2), q("known", 5.0, 0.0)]
    noise = np.full(t.size, 0.05)
    budget = propagate(
        lambda v: {"y": v["a"] * t + v["b"] * t**2 + v["known"], "z": v["a"] ** 2}, inputs, noise={"y": noise}
    )
    u = np.sqrt((0.1 * t) ** 2 + (0.2 * t**2) ** 2 + 0.05**2)
    np.testing.assert_allclose(budget.sigma("y"), u, rtol=1e-12)
    np.testing.assert_allclose(budget.freedom("y")[1:], u[1:] ** 4 / ((0.1 * t[1:]) ** 4 / 10), rtol=1e-9)
    assert budget.freedom("y")[0] == np.inf  # nothing but noise there
    assert budget.coverage_factor("y")[0] == pytest.approx(1.96, abs=1e-3)
    history = budget.history("y", "N")
    np.testing.assert_allclose(history.sigma, u, rtol=1e-12)
    table = budget.table("y", 10)
    assert [row["quantity"] for row in table] == ["b", "a", "noise", "known", "combined, y"]
    assert table[0]["sensitivity"] == pytest.approx(1.0)
    assert table[0]["share"] == pytest.approx(0.04 / u[10] ** 2)
    assert budget.sigma("z") == pytest.approx(0.6)
    numbers = budget_table(budget, {"y at the end": ("y", 10, "N"), "z": ("z", None, "N2")})
    assert numbers.results["y at the end"][:2] == pytest.approx((6.0, u[10]))
    assert [c.quantity.name for c in numbers.contributions][3:] == ["noise, y at the end", "noise, z"]
    for name in numbers.results:
        assert sum(c.shares.get(name, 0.0) for c in numbers.contributions) == pytest.approx(1.0)


def test_full_correlation_adds_linearly_and_cancels():
    inputs = [q("a", 1.0, 0.3), q("b", 1.0, 0.4)]
    pairs = {("a", "b"): 1.0}
    budget = propagate(
        lambda v: {"sum": v["a"] + v["b"], "difference": 4 * v["a"] - 3 * v["b"]}, inputs, correlations=pairs
    )
    assert budget.sigma("sum") == pytest.approx(0.7)
    assert budget.sigma("difference") == pytest.approx(0.0, abs=1e-8)  # root of round-off, 1e-16


def test_a_model_that_jumps_is_refused():
    # A window whose end moves by whole samples: the second step is half the first and sees another slope.
    def model(v):
        return {"y": np.array([np.round(v["a"])])}

    with pytest.raises(ValueError, match=r"y: differences .* disagree by .* most with a, 0\.6 1, by 1"):
        propagate(model, [q("b", 1.0, 0.1), q("a", 3.0, 0.6)])


def test_products_of_quantities_are_seen():
    # GUM 5.1.2, note: where the slopes are zero the second order is all there is.
    inputs = [q("a", 0.0, 0.2), q("b", 0.0, 3.0), q("c", 1.0, 0.1)]
    budget = propagate(lambda v: {"y": v["a"] * v["b"] + v["c"]}, inputs)
    assert budget.sigma("y") == pytest.approx(0.1)
    assert abs(budget.interaction["y"]) == pytest.approx(0.2 * 3.0)
    assert budget.nonlinearity("y") == pytest.approx(6.0)


def test_a_model_at_the_round_off_is_refused():
    with pytest.raises(ValueError, match="disagree"):
        propagate(lambda v: {"y": v["a"] + 1e16}, [q("a", 1.0, 3.0)])


@pytest.mark.parametrize(
    ("inputs", "options", "message"),
    [
        ([q("a", 1.0, 0.1), q("a", 1.0, 0.1)], {}, "quantity 'a' occurs twice"),
        ([q("a", np.nan, 0.1)], {}, "a: value must be finite"),
        ([q("a", 1.0, -0.1)], {}, "sigma finite and >= 0, got 1.0, -0.1"),
        ([q("a", 1.0, 0.1, 0.5)], {}, "degrees of freedom must be >= 1, got 0.5"),
        ([q("a", 1.0, 0.1, kind="C")], {}, "kind must be 'A' or 'B', got 'C'"),
        ([q("a", 1.0, 2.0)], {}, "the model fails at a = -1 1: root of -1"),
        ([q("a", 1.0, 1.0)], {}, "output y is not finite at sample 0 with a = 0 1"),
        ([q("a", 1.0, 0.1)], {"noise": {"w": 1.0}}, "noise of 'w': no output"),
        ([q("a", 1.0, 0.1)], {"noise": {"y": -1.0}}, "noise of y must be finite and >= 0"),
        ([q("a", 1.0, 0.1)], {"correlations": {("a", "b"): 0.1}}, "correlation of 'b': no quantity"),
        ([q("a", 1.0, 0.1)], {"correlations": {("a", "a"): 0.1}}, "must be of two"),
    ],
)
def test_impossible_budgets_are_refused(inputs, options, message):
    def model(v):
        if v["a"] < 0.0:
            raise ValueError(f"root of {v['a']:.0f}")
        return {"y": np.log(v["a"]) if v["a"] > 0.0 else -np.inf}

    with pytest.raises(ValueError, match=message):
        propagate(model, inputs, **options)


def test_contradicting_correlations_are_refused():
    pairs = {("a", "b"): 0.9, ("b", "c"): 0.9, ("a", "c"): -0.9}
    with pytest.raises(ValueError, match="contradict each other"):
        propagate(total, FOUR, correlations=pairs)


def test_outputs_keep_their_shapes():
    with pytest.raises(ValueError, match="change their names or shapes with a = 0"):
        propagate(lambda v: {"y": np.zeros(3 + int(v["a"] < 1.0))}, [q("a", 1.0, 1.0)])


def test_quantities_that_are_listed_twice():
    assert merge_quantities([*FOUR, FOUR[1]]) == FOUR
    assert (
        merge_quantities([q("a", 0.0, 0.0), FOUR[0]])
        == merge_quantities([FOUR[0], q("a", 0.0, 0.0)])
        == FOUR[:1]
    )
    with pytest.raises(ValueError, match="quantity 'a' is stated twice"):
        merge_quantities([FOUR[0], q("a", 0.1, 0.0)])
    with pytest.raises(ValueError, match="quantity 'a' is stated twice"):
        merge_quantities([FOUR[0], q("a", 0.0, 2.0)])


def test_noise_goes_through_the_model_by_draws():
    # The integral of red noise: closed form by Noise.sigma_of_sums, draws through the same sum.
    noise = Noise(2.0, 0.8 ** np.arange(60.0))
    slope = 0.5 * np.arange(50.0)
    spread = monte_carlo(
        lambda v, rng: {"y": np.cumsum(v["a"] + noise.draw(50, rng))},
        [q("a", 0.5, 0.0)],
        trials=4000,
        rng=np.random.default_rng(5),
    )["y"]
    np.testing.assert_allclose(spread.sigma, noise.sigma_of_sums(50), rtol=0.045)  # 1.1 %, four of them
    # Four standard errors of the mean.
    assert (np.abs(spread.mean - 0.5 - slope) < 4.5 * noise.sigma_of_sums(50) / np.sqrt(4000)).all()


def test_t_distribution_of_a_type_a_quantity():
    spread = monte_carlo(
        lambda v, rng: dict(v), [q("a", 1.0, 0.1, 5.0, "A")], trials=40_000, rng=np.random.default_rng(6)
    )["a"]
    assert spread.sigma == pytest.approx(0.1 * np.sqrt(5 / 3), rel=0.05)  # heavy tails: 1.2 %, four of them
    assert spread.high - 1.0 == pytest.approx(0.1 * 2.571, rel=0.05)  # t_95(5)
    with pytest.raises(ValueError, match="2 degrees of freedom has no standard deviation"):
        monte_carlo(total, [q("a", 1.0, 0.1, 2.0)], trials=100, rng=np.random.default_rng(0))


@pytest.mark.parametrize("kind", ["rectangular", "triangular", "arcsine"])
def test_distributions_have_the_stated_sigma(kind):
    ends = {"rectangular": np.sqrt(3.0), "triangular": np.sqrt(6.0), "arcsine": np.sqrt(2.0)}
    draws = []
    monte_carlo(
        lambda v, rng: draws.append(v["a"]) or dict(v),
        [q("a", 0.0, 1.0)],
        trials=10_000,
        rng=np.random.default_rng(7),
        distributions={"a": kind},
    )
    assert np.std(draws) == pytest.approx(1.0, rel=0.03)  # 0.7 % or less, four of them
    assert np.max(np.abs(draws)) <= ends[kind]
    assert np.max(np.abs(draws)) > 0.97 * ends[kind]


def test_impossible_draws_are_refused():
    rng = np.random.default_rng(0)
    for options, message in (
        ({"trials": 10}, "at least 100 trials, got 10"),
        ({"probability": 1.0}, r"inside \(0, 1\), got 1.0"),
        ({"distributions": {"z": "normal"}}, "distribution of 'z': no quantity"),
        ({"distributions": {"a": "flat"}}, "a: distribution must be 't' or one of normal, .* got 'flat'"),
        (
            {"distributions": {"a": "arcsine"}, "correlations": {("a", "b"): 0.5}},
            "a is correlated and must be normal, got 'arcsine'",
        ),
    ):
        with pytest.raises(ValueError, match=message):
            monte_carlo(total, FOUR, **({"trials": 100, "rng": rng} | options))
