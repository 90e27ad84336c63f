"""Faults of intervals, verdicts and covariances of any function of a box."""

from tests.mutants.fault import Fault

LEDGER = ("tests/unit/doe/test_doe_ledger.py",)
VERDICTS = ("tests/unit/doe/test_doe_verdicts.py",)
WHITENING = ("tests/unit/doe/test_whitening.py",)

FAULTS = (
    Fault(
        name="an interval rests on others at thirty times its length",
        file="doe/uncertainty/profile.py",
        right="INFLATION = 3.0",
        wrong="INFLATION = 30.0",
        tests=VERDICTS,
    ),
    Fault(
        name="inflation upside down",
        file="doe/uncertainty/profile.py",
        right="return (upper - lower) / (above - below)",
        wrong="return (above - below) / (upper - lower)",
        tests=VERDICTS,
    ),
    Fault(
        name="a 90 per cent level",
        file="doe/uncertainty/profile.py",
        right="LEVEL = float(chdtri(1, 0.05))",
        wrong="LEVEL = float(chdtri(1, 0.1))",
        tests=VERDICTS,
    ),
    Fault(
        name="a level of two degrees of freedom",
        file="doe/uncertainty/profile.py",
        right="LEVEL = float(chdtri(1, 0.05))",
        wrong="LEVEL = float(chdtri(2, 0.05))",
        tests=VERDICTS,
    ),
    Fault(
        name="correlation left out of the level",
        file="doe/uncertainty/profile.py",
        right="levels = level * np.broadcast_to(np.asarray(correlation, dtype=np.float64), (box.dimension,))",
        wrong="levels = level * np.ones(box.dimension)",
        tests=VERDICTS,
    ),
    Fault(
        name="the residual's variance over the number of data",
        file="doe/uncertainty/covariance.py",
        right="s2 = float(residual @ residual) / (k - d) if scaled else 1.0",
        wrong="s2 = float(residual @ residual) / k if scaled else 1.0",
        tests=VERDICTS,
    ),
    Fault(
        name="one degree of freedom too many in blocks",
        file="doe/uncertainty/covariance.py",
        right="n_blocks / (n_blocks - d))",
        wrong="n_blocks / (n_blocks - d + 1))",
        tests=VERDICTS,
    ),
    Fault(
        name="four blocks a parameter are enough",
        file="doe/uncertainty/covariance.py",
        right="if n_blocks <= 4 * d:",
        wrong="if n_blocks < 4 * d:",
        tests=VERDICTS,
    ),
    Fault(
        name="a quadratic with one degree of freedom too many",
        file="doe/surrogates/quadratic.py",
        right="return len(self.points) - len(self.coefficients)",
        wrong="return len(self.points) - len(self.coefficients) + 1",
        tests=("tests/unit/doe/test_doe_quadratic.py",),
    ),
    Fault(
        name="a row of the ledger is believed whatever its digest",
        file="doe/ledger.py",
        right="digest == digest_of(row[:-2])\n        and key",
        wrong="len(digest) == 32\n        and key",
        tests=LEDGER,
    ),
    Fault(
        name="the root of a common error forgotten",
        file="doe/least_squares.py",
        right="/ (root * (1.0 + root))",
        wrong="/ root",
        tests=WHITENING,
    ),
    Fault(
        name="a common error's precision as its square",
        file="doe/least_squares.py",
        right="(scaled @ common.T) / total)",
        wrong="(scaled @ common.T) / np.sqrt(total))",
        tests=WHITENING,
    ),
    Fault(
        name="the determinant without common errors",
        file="doe/least_squares.py",
        right=" + np.log(total).sum())",
        wrong=")",
        tests=WHITENING,
    ),
)
