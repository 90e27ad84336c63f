"""Faults of the report: rounding by the uncertainty, shares, limits shown, squares added, factors k = 2."""

from tests.mutants.fault import Fault

NUMBERS = ("tests/unit/report/test_numbers.py",)
TABLES = ("tests/unit/report/test_interval_tables.py",)

ROUNDING = "kolsky/results/numbers.py"
IDENTIFICATION = "kolsky/report/pages/identification.py"
UNCERTAINTY = "kolsky/report/pages/uncertainty.py"
SPEED = ("tests/unit/report/test_page_speed.py",)
BESIDE = ("tests/unit/report/test_page_process.py",)

FAULTS = (
    Fault(
        "a value is rounded to the third digit of its uncertainty",
        ROUNDING,
        "last = _exponent(uncertainty, digits=2) - 1",
        "last = _exponent(uncertainty, digits=2) - 2",
        NUMBERS,
    ),
    Fault(
        "the digits of an uncertainty are counted before it is rounded",
        ROUNDING,
        "last = _exponent(uncertainty, digits=2) - 1",
        "last = _exponent(uncertainty, digits=9) - 1",
        NUMBERS,
    ),
    Fault(
        "a part is rounded as coarsely as the whole",
        ROUNDING,
        "last = _exponent(uncertainty, digits=2) - 2",
        "last = _exponent(uncertainty, digits=2) - 1",
        NUMBERS,
    ),
    Fault(
        "a percentage of ten",
        ROUNDING,
        "plain(100.0 * share, digits)",
        "plain(10.0 * share, digits)",
        NUMBERS,
    ),
    Fault(
        "a value without a known uncertainty is rounded like one with it",
        ROUNDING,
        "and math.isfinite(uncertainty) and uncertainty > 0.0):\n        return plain(value), plain",
        "and math.isfinite(uncertainty)):\n        return plain(value), plain",
        NUMBERS,
    ),
    Fault(
        "the shown U of an estimate is u",
        IDENTIFICATION,
        "    U = 2.0 * estimate.sigma\n    value, uncertainty",
        "    U = 1.0 * estimate.sigma\n    value, uncertainty",
        TABLES,
    ),
    Fault(
        "shares of the standard uncertainty, not of the variance",
        IDENTIFICATION,
        "variance = estimate.sigma**2 if",
        "variance = estimate.sigma if",
        TABLES,
    ),
    Fault(
        "parts of the noise are added, not their squares",
        IDENTIFICATION,
        "np.hypot.reduce(parts), whole",
        "np.add.reduce(parts), whole",
        TABLES,
    ),
    Fault(
        "parts that miss a tenth of the noise pass for its whole",
        IDENTIFICATION,
        "whole, rtol=0.02",
        "whole, rtol=0.1",
        TABLES,
    ),
    Fault(
        "the declared uncertainties have no line in the budget",
        IDENTIFICATION,
        "if estimate.sigma_systematic > 0.0:",
        "if estimate.sigma_systematic < 0.0:",
        TABLES,
    ),
    Fault(
        "halving a part takes half of its square",
        UNCERTAINTY,
        "total**2 - 0.75 * sigma**2",
        "total**2 - 0.5 * sigma**2",
        TABLES,
    ),
    Fault("parts of a tenth are not listed", UNCERTAINTY, "LEAST = 0.02", "LEAST = 0.1", TABLES),
    Fault("parts of a hundredth are listed", UNCERTAINTY, "LEAST = 0.02", "LEAST = 0.01", TABLES),
    Fault(
        "other free parameters count only where they double an interval",
        UNCERTAINTY,
        "0.0 < alone < 0.95 * together",
        "0.0 < alone < 0.5 * together",
        TABLES,
    ),
    Fault(
        "a declared input that lowers the answer has a negative part",
        UNCERTAINTY,
        "abs(declared.shifts[estimate.name])",
        "declared.shifts[estimate.name]",
        TABLES,
    ),
    Fault(
        "a longer reference curve is never asked for",
        UNCERTAINTY,
        "share > PAST_CURVE and",
        "share > 1.0 and",
        TABLES,
    ),
    Fault(
        "the shift of another mesh has the wrong sign",
        UNCERTAINTY,
        "-e.mesh_shift",
        "e.mesh_shift",
        TABLES,
    ),
    Fault(
        "a declared share is shown as a number",
        UNCERTAINTY,
        'else (100.0, "%")',
        'else (1.0, "%")',
        TABLES,
    ),
    Fault(
        "the scatter of shots has n degrees of freedom",
        "kolsky/report/pages/rates.py",
        "2.0 * float(np.std(column, ddof=1))",
        "2.0 * float(np.std(column, ddof=0))",
        TABLES,
    ),
    Fault(
        "quoted results of bars are shown with u for U",
        "kolsky/report/pages/waves.py",
        "2.0 * factor * sigma",
        "factor * sigma",
        TABLES,
    ),
    Fault(
        "parameters of cameras are shown with u for U",
        "kolsky/report/pages/calibration.py",
        "numbers.measured(float(value), 2.0 * sigma)",
        "numbers.measured(float(value), sigma)",
        TABLES,
    ),
    Fault(
        "the line of the terminal has u for U",
        "kolsky/results/printed.py",
        "numbers.measured(e.value, 2.0 * e.sigma)",
        "numbers.measured(e.value, e.sigma)",
        TABLES,
    ),
    Fault(
        "noise and discrepancy are added in the weights of the figures",
        "kolsky/report/figures/base.py",
        "noise**2 / (noise**2 + tau**2)",
        "noise**2 / (noise + tau) ** 2",
        TABLES,
    ),
    Fault(
        name="a result file that could not be written is not missed",
        file="kolsky/report/result_folder.py",
        right="            written()\n",
        wrong="",
        tests=SPEED,
    ),
    Fault(
        name="figures stand in the order in which they are drawn",
        file="kolsky/report/pages/rendering.py",
        right="side_by_side([*here.values()][::-1], processes=processes)[::-1]",
        wrong="side_by_side([*here.values()][::-1], processes=processes)",
        tests=SPEED,
    ),
    Fault(
        name="a page has the figures of another check run",
        file="kolsky/report/page_process.py",
        right="known = self._ahead is not None and self._ahead.is_of(found)",
        wrong="known = self._ahead is not None",
        tests=BESIDE,
    ),
    Fault(
        name="a page of surfaces has the figures of another result",
        file="kolsky/report/page_process.py",
        right="if self.view_of(view.result) is None:",
        wrong="if self._ahead is None:",
        tests=BESIDE,
    ),
    Fault(
        name="figures drawn ahead have each other's names",
        file="kolsky/report/page_process.py",
        right="for place, k in enumerate(last_first)}",
        wrong="for place, k in enumerate(last_first[::-1])}",
        tests=BESIDE,
    ),
    Fault(
        name="a process that draws ahead does not stand back",
        file="kolsky/report/page_process.py",
        right="if os.getpid() != here and os.getpriority",
        wrong="if os.getpid() == here and os.getpriority",
        tests=BESIDE,
    ),
    Fault(
        name="a scene has its pictures at other times than its nodes",
        file="kolsky/report/scene/scene_data.py",
        right="nodes=nodes[shown],",
        wrong="nodes=nodes[: len(shown)],",
        tests=("tests/unit/report/test_scene.py",),
    ),
)
