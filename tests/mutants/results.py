"""Faults of files on disk: units, dimensions, limits, versions, and the intervals that are written."""

from tests.mutants.fault import Fault

CODEC = ("tests/unit/base/test_hdf5.py",)
RESULTS = "tests/unit/results/test_results.py"
UNTRUSTED = (f"{RESULTS}::test_untrusted_file_is_refused_in_one_line",)
JSON = (f"{RESULTS}::test_json_has_the_agreed_keys",)
ENDS = (f"{RESULTS}::test_ends_of_runs_as_columns",)
COMBINED = (
    "tests/unit/results/test_uncertainty_files.py::test_combined_uncertainty_holds_the_declared_part",
)
OLD = ("tests/unit/results/test_old_files.py",)
REDUCTION = ("tests/unit/bars/test_reduction_files.py",)
STUDIES = ("tests/unit/studies/test_output_files.py",)

HDF5 = "kolsky/base/hdf5.py"
ITEMS = "kolsky/base/hdf5_records.py"
RECORDS = "kolsky/base/hdf5_records.py"
WAVES = "kolsky/bars/reduction/output.py"

FAULTS = (
    Fault(
        "no unit written", HDF5, "if unit is not None:\n        dataset", "if False:\n        dataset", CODEC
    ),
    Fault("units not read", HDF5, 'dataset.attrs.get("units") != unit', "False", CODEC),
    Fault("the record's own unit is none", ITEMS, "return place.unit if", 'return "1" if', CODEC),
    Fault("sizes are too large only", HDF5, "if size != expected:", "if size > expected:", CODEC),
    Fault(
        "every dimension is of any size",
        HDF5,
        "else sizes.setdefault(name, size)",
        "else size",
        CODEC,
    ),
    Fault(
        "the size limit in values", HDF5, "+= dataset.size * dataset.dtype.itemsize", "+= dataset.size", CODEC
    ),
    Fault("every version is read", HDF5, "version in form.readable", "version is not None", CODEC),
    Fault("a version late", RECORDS, "place.version < item.since", "place.version <= item.since", CODEC),
    Fault("no version is older", RECORDS, "place.version < item.since", "False", OLD),
    Fault("soft links are followed", HDF5, "if not isinstance(link, h5py.HardLink):", "if False:", UNTRUSTED),
    Fault(
        "single precision is read",
        HDF5,
        "else dataset.dtype == np.dtype(STORED[kind])",
        "else True",
        UNTRUSTED,
    ),
    Fault(
        "values of other files are read",
        HDF5,
        "if dataset.external or dataset.is_virtual:",
        "if False:",
        UNTRUSTED,
    ),
    Fault("names are not looked at", ITEMS, "if self.among and unknown:", "if False:", CODEC),
    Fault("groups in any order", RECORDS, "if found != set(expected):", "if False:", CODEC),
    Fault("a forgotten field passes", RECORDS, "if known != set(self.fields):", "if False:", CODEC),
    Fault(
        "the file is not compressed as it says",
        HDF5,
        "array.size > COMPRESSED_FROM",
        "array.size >= COMPRESSED_FROM",
        CODEC,
    ),
    Fault(
        "interval of one sigma",
        "kolsky/inverse/result.py",
        "self.within(2.0 * self.sigma)",
        "self.within(1.0 * self.sigma)",
        JSON,
    ),
    Fault(
        "declared part left out of sigma",
        "kolsky/inverse/result.py",
        " + self.sigma_systematic**2",
        "",
        COMBINED,
    ),
    Fault(
        "sigma in place of the interval",
        "kolsky/results/tables.py",
        '"interval": e.interval,',
        '"interval": (e.value - e.sigma, e.value + e.sigma),',
        JSON,
    ),
    Fault("element 0 is none", "kolsky/results/tables.py", "if e >= 0 else", "if e > 0 else", ENDS),
    Fault("the sentence of every run", "kolsky/results/tables.py", "if i in lost else", "if True else", ENDS),
    Fault(
        "a waves interval of one sigma, stored",
        WAVES,
        "(value - 2.0 * sigma, value + 2.0 * sigma)",
        "(value - sigma, value + sigma)",
        REDUCTION,
    ),
    Fault(
        "a waves interval of one sigma, in JSON",
        WAVES,
        "[value - 2 * sigma, value + 2 * sigma]",
        "[value - sigma, value + sigma]",
        REDUCTION,
    ),
    Fault(
        "U(m) is u(m)",
        "kolsky/studies/rates/output.py",
        '"U(m) k=2 (1)": 2.0 * shot.sigma',
        '"U(m) k=2 (1)": shot.sigma',
        STUDIES,
    ),
    Fault(
        "U of the scatter is s",
        "kolsky/studies/rates/output.py",
        "lambda p: 2.0 * p.scatter",
        "lambda p: p.scatter",
        STUDIES,
    ),
    Fault(
        "two standard deviations are one",
        "kolsky/studies/rates/output.py",
        "2.0 * p.scatter",
        "p.scatter",
        STUDIES,
    ),
    Fault(
        "a planned interval of one sigma, in lines",
        "kolsky/studies/planning/output.py",
        "double * whole.deviations[j])",
        "0.5 * double * whole.deviations[j])",
        STUDIES,
    ),
    Fault(
        "the worst speed is the best",
        "kolsky/studies/planning/output.py",
        "sigmas.index(min(sigmas))",
        "sigmas.index(max(sigmas))",
        STUDIES,
    ),
    Fault(
        "a planned interval of one sigma",
        "kolsky/studies/planning/plan.py",
        'half = 2.0 * float(self.expected["all"].deviations[j])',
        'half = float(self.expected["all"].deviations[j])',
        STUDIES,
    ),
)
