"""Faults of the command line: texts to SI, edges of ranges, parts of a design, signs of tests."""

from tests.mutants.fault import Fault

NUMBERS = ("tests/unit/cli/test_text_arithmetic.py",)
FILES = ("tests/unit/material/test_test_files.py",)

FAULTS = (
    Fault(
        name="a quantity of zero taken for positive",
        file="kolsky/cli/texts.py",
        right="if positive and not value > 0.0:",
        wrong="if positive and not value >= 0.0:",
        tests=NUMBERS,
    ),
    Fault(
        name="a strain of one allowed",
        file="kolsky/cli/texts.py",
        right="all(0.0 < strain < 1.0 for strain in found)",
        wrong="all(0.0 < strain <= 1.0 for strain in found)",
        tests=NUMBERS,
    ),
    Fault(
        name="a mesh with one element along",
        file="kolsky/cli/texts.py",
        right="if across < 2 or along < 2 or",
        wrong="if across < 2 or along < 1 or",
        tests=NUMBERS,
    ),
    Fault(
        name="levels added, not multiplied, for the most runs",
        file="kolsky/cli/texts.py",
        right="if prod(counts) > MOST_RUNS:",
        wrong="if sum(counts) > MOST_RUNS:",
        tests=NUMBERS,
    ),
    Fault(
        name="shards counted from zero",
        file="kolsky/cli/texts.py",
        right="or not 1 <= int(part) <= int(parts)",
        wrong="or not 0 <= int(part) <= int(parts)",
        tests=NUMBERS,
    ),
    Fault(
        name="a refined mesh that is finer in one direction only",
        file="kolsky/cli/texts.py",
        right="if refined[0] <= mesh[0] or refined[1] <= mesh[1]:",
        wrong="if refined[0] <= mesh[0] and refined[1] <= mesh[1]:",
        tests=("tests/unit/cli/test_texts.py",),
    ),
    Fault(
        name="a held value taken without its unit",
        file="kolsky/cli/texts.py",
        right="            number = quantity(text, unit)",
        wrong='            number = float(text.split()[0].rstrip("%"))',
        tests=("tests/unit/cli/test_texts.py",),
    ),
    Fault(
        name="frame rate taken for the time between pictures",
        file="kolsky/cli/plan.py",
        right="return 1.0 / rate",
        wrong="return rate",
        tests=NUMBERS,
    ),
    Fault(
        name="every process takes all cores",
        file="kolsky/cli/sweep.py",
        right="(os.cpu_count() or 1) // self.processes",
        wrong="(os.cpu_count() or 1)",
        tests=NUMBERS,
    ),
    Fault(
        name="the best run of a sweep by force alone",
        file="kolsky/studies/sweep.py",
        right="best = int(np.nanargmin(phi if seen else table.phi_force))",
        wrong="best = int(np.nanargmin(table.phi_force))",
        tests=NUMBERS,
    ),
    Fault(
        name="a sweep's force and outline added without their scales",
        file="kolsky/studies/sweep.py",
        right="phi = table.phi_force / SCALE_FORCE + table.phi_shape / SCALE_SHAPE",
        wrong="phi = table.phi_force + table.phi_shape",
        tests=NUMBERS,
    ),
    Fault(
        name="sign of a quasi-static test not turned",
        file="kolsky/material/reference_curve.py",
        right='sign = 1.0 if compression == (convention == "compression-positive") else -1.0',
        wrong="sign = 1.0",
        tests=FILES,
    ),
    Fault(
        name="force over the specimen's length",
        file="kolsky/material/reference_curve.py",
        right='values["stress"] = values["force"] / specimen.area',
        wrong='values["stress"] = values["force"] / specimen.length',
        tests=FILES,
    ),
    Fault(
        name="strain of a homogeneous test taken for a stretch",
        file="kolsky/material/fits/homogeneous_test.py",
        right="else mode.at_rest + sign * table.deformation",
        wrong="else sign * table.deformation",
        tests=FILES,
    ),
    Fault(
        name="tension and compression averaged together",
        file="kolsky/material/fits/homogeneous_test.py",
        right="groups.setdefault((test.mode, bool(test.strain.sum() > 0.0)), [])",
        wrong="groups.setdefault((test.mode, True), [])",
        tests=FILES,
    ),
    Fault(
        name="threshold of dependent residuals doubled",
        file="kolsky/material/fits/tables.py",
        right="CORRELATED = 1.0",
        wrong="CORRELATED = 2.0",
        tests=FILES,
    ),
)
