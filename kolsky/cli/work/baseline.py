"""`kolsky material baseline`: quasi-static tests to the curve that a shot's stiffness refers to."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from kolsky.base.errors import InputError
from kolsky.base.files import filling, usable_folder
from kolsky.cli.work import options
from kolsky.cli.work.baselinetables import curve_table, in_words, summary, write_curve, write_modulus
from kolsky.cli.work.baselinetests import Given, read_tests, treatment_of
from kolsky.cli.work.parts import tell
from kolsky.material.reference_curve import Pull, reference_curve
from kolsky.report.formats import FIGURES


def make_baseline(given: Given, *, out: Path, formats: Sequence[str], as_json: bool) -> None:
    """Read the tests, average, correct, write and print.

    Raises
    ------
    InputError
        If a declaration or a file cannot be used, or the results cannot be written.
    """
    for name in formats:
        options.one_of("--figures", name, FIGURES)
    if out.suffix != ".csv":
        raise InputError(options.COMMAND_LINE, "is no table", key="--out", value=str(out), allowed="FILE.csv")
    folder = usable_folder(out.parent)
    treatment = treatment_of(given)
    tests, hashes = read_tests(given, treatment.specimen)
    pulls: tuple[Pull, ...] = ("first", "conditioned") if given.conditioned else ("first",)
    try:
        found = {pull: reference_curve(tests, treatment, pull=pull) for pull in pulls}
    except ValueError as error:
        raise InputError(options.COMMAND_LINE, str(error)) from error
    names = {"first": out.stem, "conditioned": f"{out.stem}_conditioned"}
    with filling(folder) as partial:
        for pull, made in found.items():
            write_curve(partial / f"{names[pull]}.csv", made)
            write_modulus(partial / f"{names[pull]}_modulus.csv", made)
            if formats:
                from kolsky.report.canvas import save_figures
                from kolsky.report.figures import BASELINES

                save_figures(
                    partial / f"{names[pull]}_figures", made, formats=tuple(formats), registry=BASELINES
                )
        table = curve_table(
            out.name, found["first"], f"{names['conditioned']}.csv" if given.conditioned else None
        )
        (partial / f"{out.stem}.toml").write_text(table, encoding="utf-8")
    said = {"inputs": hashes, "curves": {pull: summary(made) for pull, made in found.items()}}
    rows: dict[str, Any] = {}
    for pull, made in found.items():
        rows |= in_words(made, f"{pull}: " if given.conditioned else "")
    tell(
        [],
        rows,
        said if as_json else None,
        rest={"curve": out, "for shot.toml": folder / f"{out.stem}.toml"},
        warnings=list(dict.fromkeys(remark for made in found.values() for remark in made.remarks)),
    )
