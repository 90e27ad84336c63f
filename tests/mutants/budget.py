"""Faults of the error budget and of the plan of a campaign."""

from tests.mutants.fault import Fault

BUDGET = ("tests/unit/studies/test_budget.py",)

FAULTS = (
    Fault(
        name="nodes of a budget at one standard uncertainty with the weights of others",
        file="kolsky/studies/budget/budget.py",
        right="NODES = np.array([-np.sqrt(3.0), 0.0, np.sqrt(3.0)])",
        wrong="NODES = np.array([-1.0, 0.0, 1.0])",
        tests=BUDGET,
    ),
    Fault(
        name="a source whose bias is left in its uncertainty",
        file="kolsky/studies/budget/budget.py",
        right="WEIGHTS @ shift**2) - bias**2, 0.0)",
        wrong="WEIGHTS @ shift**2), 0.0)",
        tests=BUDGET,
    ),
    Fault(
        name="a slope of a source per standard uncertainty",
        file="kolsky/studies/budget/budget.py",
        right="(NODES[2] - NODES[0]) / factor.sigma)",
        wrong="(NODES[2] - NODES[0]))",
        tests=BUDGET,
    ),
    Fault(
        name="shares of the uncertainties instead of their squares",
        file="kolsky/studies/budget/budget.py",
        right="source.u**2 / self.u_sum**2",
        wrong="source.u / self.u_sum",
        tests=BUDGET,
    ),
    Fault(
        name="sources added without their squares",
        file="kolsky/studies/budget/budget.py",
        right="np.sqrt(np.nansum([source.u**2 for",
        wrong="np.abs(np.nansum([source.u for",
        tests=BUDGET,
    ),
    Fault(
        name="a failed realisation counted as no effect",
        file="kolsky/studies/budget/budget.py",
        right='bias = u = slope = float("nan")',
        wrong="bias = u = slope = 0.0",
        tests=BUDGET,
    ),
    Fault(
        name="a campaign that forgets the mean of its rates",
        file="kolsky/studies/budget/campaign.py",
        right="((x - x.mean()) ** 2).sum()",
        wrong="(x**2).sum()",
        tests=BUDGET,
    ),
    Fault(
        name="a campaign with a degree of freedom too many",
        file="kolsky/studies/budget/campaign.py",
        right="student.ppf(0.975, len(x) - 2)",
        wrong="student.ppf(0.975, len(x) - 1)",
        tests=BUDGET,
    ),
    Fault(
        name="errors common to all shots in the scatter about the line",
        file="kolsky/studies/budget/campaign.py",
        right="if not source.factor.shared]",
        wrong="if source.factor.sigma]",
        tests=BUDGET,
    ),
)
