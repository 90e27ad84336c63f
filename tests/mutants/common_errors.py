"""Faults of errors that many data have in common: the outline's slow error, the front face's likely path."""

from tests.mutants.fault import Fault

SLOW = ("tests/unit/inverse/test_common_errors.py",)
PATH = ("tests/unit/inverse/test_likely_path.py",)

FAULTS = (
    Fault(
        name="a slow error whose mean square is the number of its patterns",
        file="kolsky/inverse/common_errors.py",
        right="patterns / np.sqrt((patterns**2).sum(axis=0).mean())",
        wrong="patterns / np.sqrt((patterns**2).mean())",
        tests=SLOW,
    ),
    Fault(
        name="an amplitude without the determinant",
        file="kolsky/inverse/common_errors.py",
        right="return float((np.log(total) + seen / total).sum())",
        wrong="return float((seen / total).sum())",
        tests=SLOW,
    ),
    Fault(
        name="an amplitude where independent errors explain the residual",
        file="kolsky/inverse/common_errors.py",
        right="if deviance(float(steps[first])) >= float(seen.sum()):",
        wrong="if False:",
        tests=SLOW,
    ),
    Fault(
        name="the slow error not in the weights",
        file="kolsky/inverse/objective.py",
        right="[self.known_common, self.slow_discrepancy * self.slow_patterns]",
        wrong="[self.known_common, 0.0 * self.slow_patterns]",
        tests=SLOW,
    ),
    Fault(
        name="the slow error not in the covariance",
        file="kolsky/inverse/objective.py",
        right="known = self.spread_of_prior(jacobian, part) + slow @ slow.T",
        wrong="known = self.spread_of_prior(jacobian, part)",
        tests=SLOW,
    ),
    Fault(
        name="amplitudes of a path without their prior",
        file="kolsky/inverse/likely_path.py",
        right="objective.whitening().precision(residual)",
        wrong="(residual / objective.own_sigma**2)",
        tests=PATH,
    ),
    Fault(
        name="a path moved the wrong way",
        file="kolsky/inverse/likely_path.py",
        right="jerk=fitted.jerk + (amplitudes @ self.shares)",
        wrong="jerk=fitted.jerk - (amplitudes @ self.shares)",
        tests=PATH,
    ),
    Fault(
        name="shares of the sum of the replicates, not of their mean square",
        file="kolsky/inverse/likely_path.py",
        right="left[:, kept].T / root, deviations)",
        wrong="left[:, kept].T, deviations)",
        tests=PATH,
    ),
    Fault(
        name="every path followed",
        file="kolsky/inverse/surrogate_mesh_search.py",
        right="followed = 0.0 if VALLEY in stages.box.names else FOLLOWED",
        wrong="followed = 0.0",
        tests=PATH,
    ),
    Fault(
        name="patterns hold Poisson's ratio where the path is off by little",
        file="kolsky/inverse/surrogate_mesh_search.py",
        right="followed = 0.0 if VALLEY in stages.box.names else FOLLOWED",
        wrong="followed = FOLLOWED",
        tests=PATH,
    ),
    Fault(
        name="one parameter without the path's noise",
        file="kolsky/inverse/surrogate_mesh_search.py",
        right="fine = follow_front(stages, objective, surrogate, fine)",
        wrong="pass",
        tests=PATH,
    ),
    Fault(
        name="replicates that judge the interval teach its weights",
        file="kolsky/inverse/surrogate_mesh_search.py",
        right="stages.replicate(found[first.mesh].x, lesson=False)",
        wrong="stages.replicate(found[first.mesh].x, lesson=True)",
        tests=PATH,
    ),
    Fault(
        name="modes that are run as large as the replicates that stand for them",
        file="kolsky/inverse/likely_path.py",
        right="amplitudes / np.sqrt(q), 1.0 / np.sqrt(q)",
        wrong="amplitudes / np.sqrt(q), 1.0",
        tests=PATH,
    ),
    Fault(
        name="modes in the place of replicates with the sum of their squares",
        file="kolsky/inverse/likely_path.py",
        right="return np.sqrt(q) * (self.shares",
        wrong="return (self.shares",
        tests=PATH,
    ),
    Fault(
        name="a path's amplitudes as shares of the replicates",
        file="kolsky/inverse/likely_path.py",
        right="amplitudes = len(shares) * (self.shares @ shares)",
        wrong="amplitudes = self.shares @ shares",
        tests=PATH,
    ),
    Fault(
        name="a wrong record's path followed",
        file="kolsky/inverse/likely_path.py",
        right="<= CREDIBLE",
        wrong="<= 100.0 * CREDIBLE",
        tests=PATH,
    ),
    Fault(
        name="what the path's move adds left in the predictions",
        file="kolsky/inverse/objective.py",
        right="return vectors if offset is None else vectors - offset[self.kept]",
        wrong="return vectors",
        tests=PATH,
    ),
    Fault(
        name="a curve's run counted as a motion's",
        file="kolsky/inverse/staged_runs.py",
        right="curve=(rows > moved) & (rows <= moved + n)",
        wrong="curve=(rows > moved + 1) & (rows <= moved + n)",
        tests=("tests/unit/inverse/test_replicates.py",),
    ),
    Fault(
        name="the patterns judged by what taught them",
        file="kolsky/inverse/staged_runs.py",
        right="flyer=(rows > 0) & (rows <= n)",
        wrong="flyer=(rows > 0) & (rows <= moved)",
        tests=("tests/unit/inverse/test_replicates.py",),
    ),
)
