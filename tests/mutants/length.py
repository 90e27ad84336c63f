"""Faults of the specimen's length conditioned on its pictures, and of its way to an answer."""

from tests.mutants.fault import Fault

OWN = ("tests/unit/shot/test_length_by_pictures.py",)
INPUTS = ("tests/unit/uncertainty/test_input_directions.py",)
PRINTED = ("tests/unit/report/test_length_line.py",)
JOINT = ("tests/unit/joint/test_declared_length.py",)
FILE = "kolsky/pictures/specimen_length.py"

FAULTS = (
    Fault(
        name="length: the weights of pictures and declaration changed over",
        file=FILE,
        right="used=declared + sigma**2 / whole * rim.disagreement",
        wrong="used=declared + found.pictures_sigma**2 / whole * rim.disagreement",
        tests=OWN,
    ),
    Fault(
        name="length: the lower end has no part in the pictures' sigma",
        file=FILE,
        right="pictures_sigma=float(np.hypot(rim.sigma, y_sigma))",
        wrong="pictures_sigma=rim.sigma",
        tests=OWN,
    ),
    Fault(
        name="length: its sigma stays the declared one",
        file=FILE,
        right="used_sigma=sigma * found.pictures_sigma / float(np.sqrt(whole))",
        wrong="used_sigma=sigma * (1.0 - 1e-9)",
        tests=OWN,
    ),
    Fault(
        name="length: the heights are moved the other way",
        file=FILE,
        right="y_shift=-(y_sigma**2) / whole",
        wrong="y_shift=(y_sigma**2) / whole",
        tests=OWN,
    ),
    Fault(
        name="length: the heights keep their sigma and follow too",
        file=FILE,
        right="y_sigma=y_sigma * rim.sigma / found.pictures_sigma",
        wrong="y_sigma=y_sigma",
        tests=OWN,
    ),
    Fault(
        name="length: the heights follow by a ratio of standard deviations",
        file=FILE,
        right="y_per_length=(y_sigma / found.pictures_sigma) ** 2",
        wrong="y_per_length=y_sigma / found.pictures_sigma",
        tests=OWN,
    ),
    Fault(
        name="length: the rim's sigma holds the declared length's",
        file=FILE,
        right="whole**2 - length_sigma**2 - lower_variance + more",
        wrong="whole**2 - lower_variance + more",
        tests=OWN,
    ),
    Fault(
        name="length: the rim's sigma holds the lower end's",
        file=FILE,
        right="whole**2 - length_sigma**2 - lower_variance + more",
        wrong="whole**2 - length_sigma**2 + more",
        tests=OWN,
    ),
    Fault(
        name="length: what the pictures do not tell is left out",
        file=FILE,
        right="calibration_variance(result, length) + unseen**2",
        wrong="calibration_variance(result, length)",
        tests=OWN,
    ),
    Fault(
        name="length: the calibration is taken as exact",
        file=FILE,
        right="return float(slopes @ rig.covariance @ slopes)",
        wrong="return 0.0",
        tests=OWN,
    ),
    Fault(
        name="length: an exact one moves the heights",
        file=FILE,
        right="if sigma == 0.0 or abs(found.apart) > MOST_APART:",
        wrong="if abs(found.apart) > MOST_APART:",
        tests=OWN,
    ),
    Fault(
        name="length: joined with pictures that contradict it",
        file=FILE,
        right="if sigma == 0.0 or abs(found.apart) > MOST_APART:",
        wrong="if sigma == 0.0:",
        tests=OWN,
    ),
    Fault(
        name="length: a disagreement of one sign alone is said",
        file=FILE,
        right="if abs(found.apart) <= SAID:",
        wrong="if found.apart <= SAID:",
        tests=OWN,
    ),
    Fault(
        name="length: the disagreement by the pictures' sigma alone",
        file=FILE,
        right="float(np.hypot(self.declared_sigma, self.pictures_sigma))",
        wrong="self.pictures_sigma",
        tests=OWN,
    ),
    Fault(
        name="length: the outline stays where it was",
        file="kolsky/shot/load.py",
        right="y=told.centre_line.y + length.y_shift",
        wrong="y=told.centre_line.y",
        tests=OWN,
    ),
    Fault(
        name="length: its uncertainty in metres for one relative to it",
        file="kolsky/shot/load.py",
        right='"specimen_length": length.used_sigma / length.used,',
        wrong='"specimen_length": length.used_sigma,',
        tests=OWN,
    ),
    Fault(
        name="length: heights follow a relative step as if it were metres",
        file="kolsky/uncertainty/input_changes.py",
        right="found.y_per_length * step * shot.specimen.length",
        wrong="found.y_per_length * step",
        tests=INPUTS,
    ),
    Fault(
        name="length: heights of several shots follow the wrong way",
        file="kolsky/uncertainty/budgets.py",
        right='if key == "Z_offset" else sigma * _slope(',
        wrong='if key == "Z_offset" else -sigma * _slope(',
        tests=JOINT,
    ),
    Fault(
        name="length: the heights that go with it are lower",
        file="kolsky/uncertainty/input_changes.py",
        right='return self.change("y_offset", heights)',
        wrong='return self.change("y_offset", -heights)',
        tests=INPUTS,
    ),
    Fault(
        name="length: one that was conditioned is printed as declared",
        file="kolsky/results/printed.py",
        right='LengthByPictures(**found.provenance["specimen_length"])',
        wrong='LengthByPictures(**{**found.provenance["specimen_length"], "used_sigma": 1.0})',
        tests=PRINTED,
    ),
)
