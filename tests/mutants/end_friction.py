"""Faults of end friction: the correction, its fits and refinement, its remarks."""

from tests.mutants.fault import Fault

CORRECTION = ("tests/unit/material/test_friction_correction.py",)
SPECIMEN_FITS = "kolsky/material/end_friction/fits.py"
FRICTION = "kolsky/material/end_friction/correct.py"

FAULTS = (
    Fault(
        "a declared friction's sigma left out",
        FRICTION,
        "@ slope * test.ends.sigma",
        "@ slope * 0.0",
        CORRECTION,
    ),
    Fault(
        "the safety factor of the mesh doubled",
        "kolsky/material/end_friction/fits.py",
        "ORDER, SHARE = 2.0, 0.5 * 1.25",
        "ORDER, SHARE = 2.0, 1.25",
        CORRECTION,
    ),
    Fault(
        "Richardson's divisor dropped",
        "kolsky/material/end_friction/fits.py",
        "** ORDER - 1.0)",
        "** ORDER)",
        CORRECTION,
    ),
    Fault(
        "the curve left on the coarse mesh",
        "kolsky/material/end_friction/fits.py",
        "(one.off + error.stress)",
        "(one.off)",
        CORRECTION,
    ),
    Fault(
        "a law moved away from the refined mesh",
        "kolsky/material/end_friction/fits.py",
        "one.theta - np.linalg.pinv",
        "one.theta + np.linalg.pinv",
        CORRECTION,
    ),
    Fault(
        "a law moved where the test tells nothing",
        "kolsky/material/end_friction/fits.py",
        "np.linalg.pinv(jacobian, rcond=TOLD)",
        "np.linalg.pinv(jacobian)",
        CORRECTION,
    ),
    Fault(
        "a law moved to a stress below none",
        "kolsky/material/end_friction/fits.py",
        "test.strain) > 0.0).all()",
        "test.strain) > -1e99).all()",
        CORRECTION,
    ),
    Fault(
        "a law without stress averaged with the others",
        "kolsky/material/end_friction/correct.py",
        "band.strain) > 0.0).all()",
        "band.strain) > -1e99).all()",
        CORRECTION,
    ),
    Fault(
        "derivatives with the coarse noise",
        "kolsky/material/end_friction/fits.py",
        "(test.noise / finer.noise)",
        "(finer.noise / test.noise)",
        CORRECTION,
    ),
    Fault(
        "the misfit of a moved law as before the step",
        "kolsky/material/end_friction/fits.py",
        "residual + jacobian",
        "residual + 0.0 * jacobian",
        CORRECTION,
    ),
    Fault(
        "the refined mesh with the noise of both",
        "kolsky/material/end_friction/problem.py",
        "self.noise**2 - MODEL_STRESS**2",
        "self.noise**2",
        CORRECTION,
    ),
    Fault(
        "the radius of the coarse mesh",
        "kolsky/material/end_friction/fits.py",
        "one.made.bulge + error.bulge - test.bulge",
        "one.made.bulge - test.bulge",
        CORRECTION,
    ),
    Fault(
        "what a mesh leaves of its error not in the noise",
        "kolsky/material/end_friction/problem.py",
        "REFINED_STRESS**2 + left**2",
        "REFINED_STRESS**2",
        CORRECTION,
    ),
    Fault(
        "an error of the elements averaged over the strains",
        FRICTION,
        "response[:, :n].sum(axis=1) * COMMON",
        "response[:, :n].mean(axis=1) * COMMON",
        CORRECTION,
    ),
    Fault(
        "laws that are far off moved too",
        "kolsky/material/end_friction/fits.py",
        "NEAR = 10.0",
        "NEAR = 100.0",
        CORRECTION,
    ),
    Fault(
        "a test that no law meets is used",
        "kolsky/material/end_friction/correct.py",
        "LARGEST_MISFIT = 0.03",
        "LARGEST_MISFIT = 0.3",
        CORRECTION,
    ),
    Fault("a misfit that is not in the band", FRICTION, "np.maximum(own, ", "np.minimum(own, ", CORRECTION),
    Fault(
        "neighbouring misfits taken for independent",
        FRICTION,
        "LARGEST_LIKENESS = 0.9",
        "LARGEST_LIKENESS = 0.0",
        CORRECTION,
    ),
    Fault(
        "the spread of laws squared", FRICTION, "np.sqrt(w) * (row - mean)", "w * (row - mean)", CORRECTION
    ),
    Fault(
        "BIC of a specimen with AIC's penalty",
        SPECIMEN_FITS,
        "scale + unknowns * np.log(n)",
        "scale + unknowns * 2.0",
        CORRECTION,
    ),
    Fault(
        "noise of the best law one unknown too many",
        SPECIMEN_FITS,
        "(n - unknowns[best])",
        "(n - 2 * unknowns[best])",
        CORRECTION,
    ),
    Fault("nodes that never end", SPECIMEN_FITS, "NOISE_LEFT = 1.5", "NOISE_LEFT = 15.0", CORRECTION),
    Fault(
        "constants moved against the mesh",
        "kolsky/material/end_friction/correct.py",
        "np.asarray(-one.gain",
        "np.asarray(one.gain",
        CORRECTION,
    ),
)
