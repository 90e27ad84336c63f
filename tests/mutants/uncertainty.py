"""Faults of the interval's parts and of the warnings of an identification."""

from tests.mutants.fault import Fault

NUMERICAL = ("tests/unit/uncertainty/test_numerical.py",)
NOISE = ("tests/unit/uncertainty/test_input_noise.py",)
SYSTEMATIC = ("tests/unit/uncertainty/test_systematic.py",)
WARNINGS = ("tests/unit/uncertainty/test_warnings.py",)

FAULTS = (
    Fault(
        name="the factor between index and standard uncertainty doubled",
        file="kolsky/uncertainty/numerical.py",
        right="ONE_SIDED = 1.15",
        wrong="ONE_SIDED = 2.3",
        tests=NUMERICAL,
    ),
    Fault(
        name="Richardson's divisor without its one",
        file="kolsky/uncertainty/numerical.py",
        right="((fine / coarse) ** ORDER - 1.0)",
        wrong="((fine / coarse) ** ORDER)",
        tests=NUMERICAL,
    ),
    Fault(
        name="the ratio of the meshes upside down",
        file="kolsky/uncertainty/numerical.py",
        right="((fine / coarse) ** ORDER",
        wrong="((coarse / fine) ** ORDER",
        tests=NUMERICAL,
    ),
    Fault(
        name="a mesh error of first order",
        file="kolsky/uncertainty/numerical.py",
        right="ORDER = 2.0",
        wrong="ORDER = 1.0",
        tests=NUMERICAL,
    ),
    Fault(
        name="no safety factor on the mesh error",
        file="kolsky/uncertainty/numerical.py",
        right="SAFETY_FACTOR = 1.25",
        wrong="SAFETY_FACTOR = 1.0",
        tests=NUMERICAL,
    ),
    Fault(
        name="the other element as a normal distribution",
        file="kolsky/uncertainty/numerical.py",
        right="EITHER_SIDE = 3.0**0.5",
        wrong="EITHER_SIDE = 2.0",
        tests=NUMERICAL,
    ),
    Fault(
        name="the smaller of mesh and element",
        file="kolsky/uncertainty/numerical.py",
        right='np.fmax(found["mesh"]',
        wrong='np.fmin(found["mesh"]',
        tests=NUMERICAL,
    ),
    Fault(
        name="replicates about their own mean",
        file="kolsky/uncertainty/input_noise.py",
        right="np.sqrt((moves**2).mean(axis=0))",
        wrong="moves.std(axis=0)",
        tests=NOISE,
    ),
    Fault(
        name="the smallest move of a common scale",
        file="kolsky/uncertainty/input_noise.py",
        right="np.max([np.abs(gain @ change) for gain in gains], axis=0)",
        wrong="np.min([np.abs(gain @ change) for gain in gains], axis=0)",
        tests=NOISE,
    ),
    Fault(
        name="the curve's replicates counted as the flyer's",
        file="kolsky/uncertainty/input_noise.py",
        right='"flyer motion": replicate_uncertainty(moves[flyer])',
        wrong='"flyer motion": replicate_uncertainty(moves[curve])',
        tests=NOISE,
    ),
    Fault(
        name="declared parts added, not their squares",
        file="kolsky/uncertainty/analyse.py",
        right="np.sqrt(sum(part.shifts.get(name, 0.0) ** 2 for part in self.systematic))",
        wrong="abs(sum(part.shifts.get(name, 0.0) for part in self.systematic))",
        tests=SYSTEMATIC,
    ),
    Fault(
        name="correlated residuals narrow a profile",
        file="kolsky/uncertainty/profile_likelihood.py",
        right="np.maximum(np.diag(together) / np.diag(alone), 1.0)",
        wrong="np.diag(alone) / np.diag(together)",
        tests=SYSTEMATIC,
    ),
    Fault(
        name="a profile is confirmed at its whole level",
        file="kolsky/uncertainty/profile_likelihood.py",
        right="TOLERANCE = 0.1",
        wrong="TOLERANCE = 1.0",
        tests=WARNINGS,
    ),
    Fault(
        name="a tenth of the specimen past the curve before it is said",
        file="kolsky/uncertainty/warnings/runs.py",
        right="PAST_CURVE = 0.01",
        wrong="PAST_CURVE = 0.1",
        tests=WARNINGS,
    ),
    Fault(
        name="a tenth of the strain energy artificial before it is said",
        file="kolsky/uncertainty/warnings/runs.py",
        right="ARTIFICIAL = 0.01",
        wrong="ARTIFICIAL = 0.1",
        tests=WARNINGS,
    ),
    Fault(
        name="the other branch of the curve",
        file="kolsky/uncertainty/warnings/runs.py",
        right="lam = roots.max() if branch > 0.0",
        wrong="lam = roots.max() if branch < 0.0",
        tests=WARNINGS,
    ),
    Fault(
        name="a tenth of the work missing before it is said",
        file="kolsky/uncertainty/warnings/answer.py",
        right="IMBALANCE = 0.01",
        wrong="IMBALANCE = 0.1",
        tests=WARNINGS,
    ),
    Fault(
        name="routes compared with one sigma",
        file="kolsky/uncertainty/warnings/answer.py",
        right="both = 2.0 * hypot(",
        wrong="both = hypot(",
        tests=WARNINGS,
    ),
    Fault(
        name="routes compared without the numerics",
        file="kolsky/uncertainty/warnings/answer.py",
        right="shape.sigma[name], e.sigma_numerical, *inputs)",
        wrong="shape.sigma[name], *inputs)",
        tests=WARNINGS,
    ),
    Fault(
        name="a declared sigma believed within thirteen times",
        file="kolsky/uncertainty/warnings/inputs.py",
        right="SIGMA_RATIO = 1.3",
        wrong="SIGMA_RATIO = 13.0",
        tests=WARNINGS,
    ),
    Fault(
        name="chi-square compared with the ratio of sigmas",
        file="kolsky/uncertainty/warnings/inputs.py",
        right="elif not SIGMA_RATIO**-2 <= chi2 <= SIGMA_RATIO**2:",
        wrong="elif not SIGMA_RATIO**-1 <= chi2 <= SIGMA_RATIO:",
        tests=WARNINGS,
    ),
    Fault(
        name="white noise within thirty over the root",
        file="kolsky/uncertainty/warnings/inputs.py",
        right="WHITE = 3.0",
        wrong="WHITE = 30.0",
        tests=WARNINGS,
    ),
    Fault(
        name="white noise over the number, not its root",
        file="kolsky/uncertainty/warnings/inputs.py",
        right="limit = WHITE / sqrt(n)",
        wrong="limit = WHITE / n",
        tests=WARNINGS,
    ),
)
