"""One page of every type, or several if a page has several forms."""

import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "helpers"), str(ROOT / "tests" / "unit" / "report")]

COMMANDS = {
    "specimen": ("bodies/test_specimen_commands.py::test_simulate_fit_and_plan", "fit/specimen.html"),
    "sheet": ("bodies/test_specimen_commands.py::test_sheet", "fit/specimen.html"),
    "actuator": ("bodies/test_actuator.py::test_simulate_invert_and_control", "s/actuator.html"),
    "actuator-invert": ("", "i/actuator.html"),
    "actuator-control": ("", "c/actuator.html"),
    "joint": ("joint/test_identify_shots.py::test_files_and_page_say_the_same", "out/joint.html"),
    "relaxation": ("joint/test_slow_tests.py::test_from_files_to_the_constants", "out/relaxation.html"),
    "material": ("cli/test_material_command.py::test_from_files_to_a_report", "out/material.html"),
    "dic-alone": ("cli/test_dic_alone_command.py::test_files_tables_and_page_are_there", "results0/dic.html"),
    "calibration": ("cli/test_dic_alone_command.py::test_the_files_say_the_same", "calibration.html"),
    "prediction": ("prediction/test_predict.py::test_the_command", "p/prediction.html"),
    "plan": ("studies/test_plan.py::test_files_hold_the_map", "plan.html"),
    "check": ("cli/test_cli_new_check.py", "shot/results/check.html"),
    "waves": ("cli/test_bar_results.py", "results/waves.html"),
}
"""Name of a page: the test (in tests/unit) whose command writes it, and the end of the file's path."""


def by_commands(folder: Path) -> None:
    """Run the tests whose commands write pages, and take the pages; a failing test ends it."""
    tests = sorted({str(ROOT / "tests" / "unit" / test) for test, _ in COMMANDS.values() if test})
    with tempfile.TemporaryDirectory() as scratch:
        words = ["-q", "--long", "-p", "no:cacheprovider", f"--basetemp={scratch}/t", *tests]
        subprocess.run([sys.executable, "-m", "pytest", *words], cwd=ROOT, check=True)
        for name, (test, end) in COMMANDS.items():
            case = test.partition("::")[2][:30]
            found = [path for path in sorted(Path(scratch).rglob("*.html")) if str(path).endswith(end)]
            known = [path for path in found if case and case in str(path)]
            shutil.copy((known or found)[0], folder / f"{name}.html")


def _budget() -> str:
    from test_budget_page import planned_page

    return planned_page()


def _rates(count: int) -> str:
    from test_rates_report import five

    from kolsky.report.pages.rates import render
    from kolsky.studies.rates.comparison import compare

    return render(compare(five(curve=0.004)[:count]))


def _sweep(*, one: bool) -> str:
    from test_sweep_report import along, analysed

    from kolsky.report.pages.studies import render_sweep

    return render_sweep(along() if one else analysed(n=512, lost=(5,)))


def _report(which: str) -> str:
    from synthetic import RESULTS

    from kolsky.report.pages.identification import render

    return render(RESULTS[which])


RENDERED: dict[str, Callable[[], str]] = {
    "budget": _budget, "rates": lambda: _rates(5), "rates-one": lambda: _rates(1),
    "sweep": lambda: _sweep(one=False), "sweep-one": lambda: _sweep(one=True),
    "report": lambda: _report("one"), "report-two": lambda: _report("two"),
}  # fmt: skip
"""Name of a page made from results that are made up, and what renders it."""
