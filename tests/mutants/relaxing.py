"""Faults in what relaxes, and in the choice between with it and without."""

from tests.mutants.fault import Fault

_BRANCH = "kolsky/diagnosis/relaxation.py"
_RELAXING = "kolsky/inverse/parameters.py"


def _fault(name: str, file: str, right: str, wrong: str, test: str) -> Fault:
    return Fault(name=name, file=file, right=right, wrong=wrong, tests=(f"tests/unit/{test}",))


FAULTS = (
    _fault(
        "a strength below zero explains as well",
        _BRANCH,
        "gain = max(max(0.0, float(score[best])) ** 2,",
        "gain = max(float(score[best]) ** 2,",
        "diagnosis/test_branch_test.py",
    ),
    _fault(
        "the best of several times judged as if one had been tried",
        _BRANCH,
        ".max(axis=1) ** 2",
        "[:, 0] ** 2",
        "diagnosis/test_branch_test.py",
    ),
    _fault(
        "residuals of a block taken for independent evidence",
        _BRANCH,
        "scale[k] = max(scale[k],",
        "scale[k] = max(scale[k], 0.0 *",
        "diagnosis/test_branch_test.py",
    ),
    _fault(
        "what the parameters follow counted for the branch",
        _BRANCH,
        "own = directions - (directions @ basis) @ basis.T",
        "own = directions.copy()",
        "diagnosis/test_branch_test.py",
    ),
    _fault(
        "every run of a batch with the first series",
        _RELAXING,
        "choice = index.ravel() if len(index) > 1",
        "choice = 0 * index.ravel() if len(index) > 1",
        "inverse/test_relaxing.py",
    ),
    _fault(
        "strengths taken for times",
        _RELAXING,
        "PronySeries(tuple(row[:n].tolist()), tuple(row[n:].tolist()))",
        "PronySeries(tuple(row[n:].tolist()), tuple(row[:n].tolist()))",
        "inverse/test_relaxing.py",
    ),
    _fault(
        "directions of a branch whose ringing is out of step",
        _RELAXING,
        "(0.5 - np.asarray(poisson)) * np.asarray(stiffer)",
        "(0.5 - np.asarray(poisson))",
        "inverse/test_relaxing.py",
    ),
    _fault(
        "what a search for a branch has gained left out",
        _BRANCH,
        "realised / float(scale.max()) ** 2)",
        "0.0)",
        "diagnosis/test_branch_test.py",
    ),
    _fault(
        "what a search has gained by residuals that are correlated",
        _BRANCH,
        "realised / float(scale.max()) ** 2)",
        "realised)",
        "diagnosis/test_branch_test.py",
    ),
    _fault(
        "a branch that explains a tenth of what is left advised",
        "kolsky/diagnosis/relaxation.py",
        "HALF = 0.5",
        "HALF = 0.1",
        "diagnosis/test_rate_advice.py",
    ),
    _fault(
        "a search for a branch that leaves the ringing's pace",
        "kolsky/diagnosis/relaxation.py",
        "stiffer = root if MOVED in box.names else root**2",
        "stiffer = root**2",
        "diagnosis/test_rate_advice.py",
    ),
    _fault(
        "what is left counted by its size and not its square",
        "kolsky/diagnosis/relaxation.py",
        "((size / o.noise) ** 2).sum()",
        "(size / o.noise).sum()",
        "diagnosis/test_rate_advice.py",
    ),
    _fault(
        "a branch at a bound of its range advised",
        "kolsky/diagnosis/relaxation.py",
        "return self.inside and self.aic < 0.0 and self.share >= HALF",
        "return self.aic < 0.0 and self.share >= HALF",
        "diagnosis/test_rate_advice.py",
    ),
)
