"""Faults of the material's curves, fits and rate dependence."""

from tests.mutants.fault import Fault

VERDICTS = ("tests/unit/material/test_material_verdicts.py",)
BAND = ("tests/unit/material/test_baseline_band.py",)
FITS = (
    "tests/unit/material/test_material_fits.py::test_criteria_by_hand",
    "tests/unit/material/test_material_fits.py::test_known_noise_and_its_weights",
)
STABILITY = ("tests/unit/material/test_material_stability.py",)
CURVE = "kolsky/material/uniaxial.py"
UNIAXIAL = "kolsky/material/uniaxial.py"
MEASURES = ("tests/unit/material/test_properties.py",)
PROPERTIES = "kolsky/material/fits/properties.py"
REFERENCE = "kolsky/material/reference_curve.py"
GOODNESS = "kolsky/material/fits/fit.py"
RATE = "kolsky/material/relaxation/rate_fit.py"

FAULTS = (
    Fault(
        "Student's factor with one degree of freedom too many",
        CURVE,
        "student.ppf(norm.cdf(COVERAGE), freedom)",
        "student.ppf(norm.cdf(COVERAGE), freedom + 1)",
        VERDICTS,
    ),
    Fault(
        "the scatter of tests, not of their mean",
        CURVE,
        "np.sqrt(count * (count - 1.0))",
        "np.sqrt(count - 1.0)",
        BAND,
    ),
    Fault(
        "the median's constant inverted",
        CURVE,
        "np.median(np.abs(gap)) / norm.ppf(0.75)",
        "np.median(np.abs(gap)) * norm.ppf(0.75)",
        VERDICTS,
    ),
    Fault("common parts averaged away", CURVE, "(common**2).sum()", "(common**2).mean()", VERDICTS),
    Fault(
        "a toe's scatter with two degrees of freedom too many",
        UNIAXIAL,
        "(e.size - 2)",
        "(e.size)",
        VERDICTS,
    ),
    Fault(
        "the sigma of a toe's slope for that of its zero",
        UNIAXIAL,
        "np.sqrt(covariance[1, 1])",
        "np.sqrt(covariance[0, 0])",
        VERDICTS,
    ),
    Fault("ramps that end with the noise", UNIAXIAL, "REVERSAL = 0.05", "REVERSAL = 0.005", VERDICTS),
    Fault(
        "the toe's sigma not in the band of one test",
        REFERENCE,
        "if begun[0].sigma > 0.0:",
        "if False:",
        VERDICTS,
    ),
    Fault(
        "the declared scale not in the band",
        REFERENCE,
        "if treatment.scale_sigma > 0.0:",
        "if False:",
        VERDICTS,
    ),
    Fault("strains past the data not remarked", REFERENCE, "PAST_DATA = 0.25", "PAST_DATA = 2.5", VERDICTS),
    Fault(
        "the bulge's sigma not reduced by repeating",
        REFERENCE,
        "treatment.bulge_sigma / sqrt(len(tests))",
        "treatment.bulge_sigma",
        VERDICTS,
    ),
    Fault(
        "regression with a degree of freedom too many", PROPERTIES, "(x.size - 2)", "(x.size - 1)", MEASURES
    ),
    Fault(
        "Poisson's ratio of engineering strains",
        PROPERTIES,
        "x, y = np.log(stretch), -np.log(lateral)",
        "x, y = stretch - 1.0, 1.0 - lateral",
        MEASURES,
    ),
    Fault("any dip is fracture", PROPERTIES, "DROP = 0.2", "DROP = 0.01", MEASURES),
    Fault("unloading is fracture", PROPERTIES, "BACK = 0.02", "BACK = 0.5", MEASURES),
    Fault(
        "the scatter of specimens for that of their mean",
        PROPERTIES,
        "x.std(ddof=1) / np.sqrt(x.size)",
        "x.std(ddof=1)",
        MEASURES,
    ),
    Fault(
        "one start that stands alone determines",
        "kolsky/material/fits/fit.py",
        "found.agreeing < 2",
        "found.agreeing < 1",
        MEASURES,
    ),
    Fault(
        "a compressible law without its bulk stiffness",
        "kolsky/material/fits/compare.py",
        "J**2 * volume.stiffness(J)",
        "J**2 * 0.0",
        MEASURES,
    ),
    Fault("AIC without its constants", GOODNESS, "+ 2.0 * k", "+ 1.0 * k", FITS),
    Fault("BIC with AIC's penalty", GOODNESS, "+ k * log(n)", "+ 2.0 * k", FITS),
    Fault(
        "Durbin and Watson's number halved",
        GOODNESS,
        "np.sum(np.diff(residual) ** 2) / np.sum(residual**2)",
        "np.sum(np.diff(residual) ** 2) / np.sum(residual**2) / 2.0",
        FITS,
    ),
    Fault(
        "degrees of freedom not taken off",
        "kolsky/material/fits/fit.py",
        "found.chi2 / (problem.n - int(inside.sum()))",
        "found.chi2 / problem.n",
        FITS,
    ),
    Fault(
        "the least AIC for the best law",
        "kolsky/material/fits/compare.py",
        "row.fit.bic if row.fit else np.inf",
        "row.fit.aic if row.fit else np.inf",
        VERDICTS,
    ),
    Fault(
        "laws that the data do not determine among the best",
        "kolsky/material/fits/compare.py",
        "row.fit.outcome not in doubtful",
        "row.fit.outcome is not None",
        VERDICTS,
    ),
    Fault(
        "stability along the path alone",
        "kolsky/material/fits/compare.py",
        "a * (c / largest) - b * (b / largest), a + c - largest)",
        "c, c)",
        STABILITY,
    ),
    Fault("a branch by chance", RATE, "SIGNIFICANT = 0.01", "SIGNIFICANT = 0.1", VERDICTS),
    Fault(
        "a branch at its bound taken",
        RATE,
        "or fit.aic >= before.aic or fit.at_bound:",
        "or fit.aic >= before.aic:",
        VERDICTS,
    ),
    Fault(
        "a gain with one degree of freedom",
        "kolsky/material/relaxation/rate_fit.py",
        "chi2.sf(gain, 2)",
        "chi2.sf(gain, 1)",
        VERDICTS,
    ),
    Fault(
        "the scatter does not weigh a gain",
        "kolsky/material/relaxation/rate_fit.py",
        "max(a.chi_square - b.chi_square, 0.0) / scatter",
        "max(a.chi_square - b.chi_square, 0.0)",
        VERDICTS,
    ),
    Fault(
        "moduli from strains in the noise",
        "kolsky/material/relaxation/rate_fit.py",
        "LEAST_STRAIN = 0.02",
        "LEAST_STRAIN = 0.002",
        VERDICTS,
    ),
)
