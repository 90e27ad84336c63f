"""Faults of the error budget and of the plan of a campaign."""

from tests.mutants.fault import Fault

BUDGET = ("tests/unit/studies/test_budget.py",)

FAULTS = (
    Fault(
        name="nodes of a budget at one standard uncertainty with the weights of others",
        file="kolsky/studies/budget/design.py",
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
        file="kolsky/studies/budget/records.py",
        right="source.u**2 / self.u_sum**2",
        wrong="source.u / self.u_sum",
        tests=BUDGET,
    ),
    Fault(
        name="sources added without their squares",
        file="kolsky/studies/budget/records.py",
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
    Fault(
        name="a jump to another valley in the spread of a budget",
        file="kolsky/studies/budget/budget.py",
        right="np.where(np.isfinite(near), near, whole)",
        wrong="np.where(np.isfinite(whole), whole, near)",
        tests=BUDGET,
    ),
    Fault(
        name="a re-fit that did not come to rest in the spread",
        file="kolsky/studies/budget/refit.py",
        right="return self not in (self.NOT_AT_REST, self.AT_BOUND, self.REFUSED)",
        wrong="return self not in (self.AT_BOUND, self.REFUSED)",
        tests=BUDGET,
    ),
    Fault(
        name="another valley called the same if one parameter agrees",
        file="kolsky/studies/budget/refit.py",
        right="    return all(\n        abs(near",
        wrong="    return any(\n        abs(near",
        tests=BUDGET,
    ),
    Fault(
        name="jumps counted over all draws that were asked for",
        file="kolsky/studies/budget/budget.py",
        right="searched=int(np.isfinite(whole[at:]).sum()),",
        wrong="searched=len(whole),",
        tests=BUDGET,
    ),
    Fault(
        name="joint shares of the slopes instead of their squares",
        file="kolsky/studies/budget/sampling.py",
        right="parts = np.column_stack([slopes[:, 1:] ** 2, rest])",
        wrong="parts = np.column_stack([abs(slopes[:, 1:]), rest])",
        tests=BUDGET,
    ),
    Fault(
        name="a residual variance of a line that forgets its constants",
        file="kolsky/studies/budget/sampling.py",
        right="rest = ((samples - slopes @ A.T) ** 2).sum(axis=1) / left",
        wrong="rest = ((samples - slopes @ A.T) ** 2).sum(axis=1) / n",
        tests=BUDGET,
    ),
    Fault(
        name="a bootstrap of half the residuals' size",
        file="kolsky/studies/budget/sampling.py",
        right="* np.sqrt(n / left)",
        wrong="* 0.5",
        tests=BUDGET,
    ),
    Fault(
        name="an interval of a share with the noise's draws as they were",
        file="kolsky/studies/budget/sampling.py",
        right="squares[:, drawn] = again",
        wrong="squares[:, drawn] = 0.5 * (again + u[drawn] ** 2)",
        tests=BUDGET,
    ),
    Fault(
        name="slopes of a start per distance of the nodes the wrong way round",
        file="kolsky/studies/budget/design.py",
        right="(high.results[:columns] - low.results[:columns]) / (NODES[2] - NODES[0])",
        wrong="(high.results[:columns] - low.results[:columns]) / NODES[2]",
        tests=BUDGET,
    ),
)
