"""Faults of the inverse method: misfit, objective, estimates."""

from tests.mutants.fault import Fault

OBJECTIVE = ("tests/unit/inverse/test_objective.py",)

FAULTS = (
    Fault(
        name="noise and discrepancy added, not their squares",
        file="kolsky/inverse/objective.py",
        right="return np.sqrt(self.noise**2 + tau**2)",
        wrong="return self.noise + tau",
        tests=OBJECTIVE,
    ),
    Fault(
        name="one degree of freedom too many in the sandwich",
        file="kolsky/inverse/objective.py",
        right="n_blocks / (n_blocks - d)",
        wrong="n_blocks / (n_blocks - d + 1)",
        tests=OBJECTIVE,
    ),
)
