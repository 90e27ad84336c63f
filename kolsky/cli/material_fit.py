"""`kolsky material fit`: laws fitted to homogeneous tests, compared, written and printed."""

import json
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated

import typer

from kolsky.base.errors import InputError
from kolsky.cli import texts
from kolsky.cli.options import AsJson, Figures, HeaderLine, OutFolder

if TYPE_CHECKING:
    from kolsky.material.fits.compare import Comparison
    from kolsky.material.fits.homogeneous_files import Columns
    from kolsky.material.fits.homogeneous_test import HomogeneousTest
    from kolsky.material.fits.modes import Mode


def material_fit(
    files: Annotated[
        list[str],
        typer.Argument(
            metavar="MODE:FILE...",
            help="Tests of one material: uniaxial:FILE, equibiaxial:FILE, planar:FILE or simple-shear:FILE "
            "(a FILE alone is uniaxial).",
        ),
    ],
    convention: Annotated[
        str,
        typer.Option(
            help="Sign of stress and strain in the files: tension-positive or compression-positive.",
            show_default="must be said",
        ),
    ] = "",
    stretch: Annotated[str, typer.Option(metavar="COLUMN", help="The stretch, by name or number.")] = "",
    strain: Annotated[
        str, typer.Option(metavar="COLUMN", help="Instead: the nominal strain, or the amount of shear.")
    ] = "",
    strain_unit: Annotated[
        str | None, typer.Option(help='Its unit, "1" or "%".', show_default="found")
    ] = None,
    stress: Annotated[str, typer.Option(metavar="COLUMN", help="The nominal stress.")] = "",
    stress_unit: Annotated[
        str | None, typer.Option(help='Its unit, e.g. "kPa".', show_default="found")
    ] = None,
    header_line: HeaderLine = None,
    mean: Annotated[
        int, typer.Option(min=0, help="Average the files of a mode at so many strains; 0: fit every point.")
    ] = 0,
    laws: Annotated[str, typer.Option(metavar="NAMES", help="Laws to try.", show_default="all")] = "",
    weighting: Annotated[str, typer.Option(help="absolute, relative or sigma.")] = "absolute",
    free_bounds: Annotated[
        bool,
        typer.Option("--free-bounds", help="Allow constants with which an energy can become negative."),
    ] = False,
    poisson: Annotated[
        float | None,
        typer.Option(min=0.0, max=0.49999, help="Poisson's ratio at rest.", show_default="incompressible"),
    ] = None,
    starts: Annotated[
        int, typer.Option(min=1, max=1000, help="Starts of each search that are polished.")
    ] = 12,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the starts.")] = 1,
    out: OutFolder = Path("material"),
    figures: Figures = "",
    as_json: AsJson = False,
) -> None:
    """Fit laws to homogeneous tests and compare them: errors, constants, and where each stops being stable.

    Several tests are fitted at once. Writes material.html, material.json and CSV tables.
    """
    started = perf_counter()
    formats = texts.figure_formats(figures)
    from kolsky.base.files import filling, usable_folder, write_table
    from kolsky.cli.terminal import print_result, progress_bars, since
    from kolsky.material.fits.compare import candidates, compare_laws
    from kolsky.material.fits.homogeneous_files import Columns
    from kolsky.material.fits.residuals import Weighting
    from kolsky.material.fits.tables import as_json as to_json
    from kolsky.material.fits.tables import remarks, tables

    texts.one_of("--weighting", weighting, tuple(kind.value for kind in Weighting))
    try:
        tried = candidates(texts.listed(laws))
    except ValueError as error:
        raise InputError(texts.COMMAND_LINE, f"--laws: {error}") from None
    folder = usable_folder(out)
    columns = Columns(convention, stretch, strain, strain_unit, stress, stress_unit, header_line)
    tests, hashes = read_tests(files, columns, mean=mean)
    if weighting == "sigma" and any(test.sigma is None for test in tests):
        raise InputError(
            texts.COMMAND_LINE,
            "--weighting sigma needs tests with a scatter",
            cure="give repeats and --mean, or weight absolute or relative",
        )
    with progress_bars() as progress:
        found = compare_laws(
            tried,
            tests,
            weighting=Weighting(weighting),
            bounded=not free_bounds,
            poisson=poisson,
            starts=starts,
            seed=seed,
            progress=lambda done: progress("laws", done, len(tried)),
        )
    if all(row.fit is None for row in found.rows):
        reasons = "; ".join(row.reason for row in found.rows)
        raise InputError(texts.COMMAND_LINE, f"no law can be fitted: {reasons}")
    said = to_json(found, hashes)
    from kolsky.report.canvas import save_figures
    from kolsky.report.pages.material import write_page

    with filling(folder) as partial:
        for name, table in tables(found).items():
            write_table(partial / f"{name}.csv", table)
        text = json.dumps(said, indent=2, allow_nan=False) + "\n"
        (partial / "material.json").write_text(text, encoding="utf-8")
        write_page(partial / "material.html", found, hashes, remarks(found))
        if formats:
            save_figures(partial / "figures", found, formats=formats)
    print_result(
        {},
        said if as_json else None,
        answers=_lines(found),
        rest={"report": folder / "material.html", "wall time": since(started)},
        warnings=remarks(found),
    )


def read_tests(
    files: Sequence[str], columns: "Columns", *, mean: int = 0
) -> "tuple[tuple[HomogeneousTest, ...], dict[str, str]]":
    """The tests, and the hashes of their files by path.

    Parameters
    ----------
    files
        "MODE:FILE", or a file of a uniaxial test.
    columns
        What is said of the files.
    mean
        Strains at which the files of a mode are averaged; 0 keeps each as a test with all its points.

    Raises
    ------
    InputError
        If a file cannot be read, what is said of it is not enough, or it holds no such test.
    """
    from kolsky.material.fits.homogeneous_files import means_by_mode, named_apart, read_homogeneous_test

    hashes: dict[str, str] = {}
    tests: list[HomogeneousTest] = []
    for text in files:
        mode, path = _mode_and_path(text)
        _refuse_columns(path, mode, columns)
        test, hashes[str(path)] = read_homogeneous_test(path, columns, mode=mode)
        tests.append(test)
    if mean:
        try:
            tests = means_by_mode(tests, mean)
        except ValueError as error:
            raise InputError(texts.COMMAND_LINE, f"--mean: {error}") from None
    return named_apart(tests), hashes


def _mode_and_path(text: str) -> "tuple[Mode, Path]":
    """ "planar:FILE" as a mode and a file; a file alone is uniaxial."""
    from kolsky.material.fits.modes import Mode, mode_named

    head, colon, rest = text.partition(":")
    if colon and rest:
        try:
            return mode_named(head), Path(rest)
        except ValueError:
            # A drive of Windows, or a mode that does not exist: only one of them is a file.
            if len(head) > 1 and not Path(text).exists():
                raise InputError(
                    texts.COMMAND_LINE,
                    "is no mode",
                    key=text,
                    allowed=", ".join(mode.value.replace(" ", "-") for mode in Mode)
                    + ", then a colon and FILE",
                ) from None
    return Mode.UNIAXIAL, Path(text)


def _refuse_columns(path: Path, mode: "Mode", columns: "Columns") -> None:
    """Refuse columns that are not enough for a test, or contradict each other."""
    from kolsky.material.fits.homogeneous_files import CONVENTIONS
    from kolsky.material.fits.modes import Mode
    from kolsky.readers.columns import column_names
    from kolsky.readers.contents import Layout

    texts.one_of("--convention", columns.convention, CONVENTIONS)
    if columns.stretch and columns.strain:
        raise InputError(
            texts.COMMAND_LINE, "--stretch and --strain exclude each other", cure="leave one out"
        )
    if not columns.stress or not (columns.stretch or columns.strain):
        there = ", ".join(column_names(path, Layout(header_line=columns.header_line)))
        raise InputError(
            path,
            f"does not say which columns are the test; its columns of numbers are {there}",
            cure="name stress and deformation, or give their numbers: --stress COLUMN, and --stretch COLUMN "
            "or --strain COLUMN",
        )
    if mode is Mode.SIMPLE_SHEAR and columns.stretch:
        raise InputError(
            texts.COMMAND_LINE,
            f"{path}: simple shear has no stretch",
            cure="name the amount of shear with --strain",
        )


def _lines(found: "Comparison") -> list[str]:
    """The table for a terminal of 80 columns and more, least AIC first."""
    from kolsky.material.fits.fit import FitOutcome
    from kolsky.material.fits.tables import failure

    best = found.best
    lines = [f"{'':2}{'law':<19}{'E0 (kPa)':>9}{'RMSE (kPa)':>11}{'R2':>9}{'AIC':>9}  stability"]
    for row in found.rows:
        f = row.fit
        if f is None:
            continue
        mark = "*" if row is best else "?" if f.outcome is FitOutcome.NOT_DETERMINED else " "
        lines.append(
            f"{mark} {row.candidate.name:<19}{1e-3 * f.youngs_modulus:>9.4g}{1e-3 * f.rmse:>11.4g}"
            f"{f.r_squared:>9.5f}{f.aic:>9.1f}  {failure(row)}"
        )
    lines.append("* least BIC of those determined and stable over the data; ? constants not determined")
    if best is not None and best.fit is not None:
        for spec in best.fit.law.PARAMETERS:
            if spec.name in best.fit.free:
                value, u = best.fit.values[spec.name], best.fit.sigma[spec.name]
                unit = "" if spec.unit == "1" else f" {spec.unit}"
                lines.append(f"  {spec.name} = {value:.5g} ± {2.0 * u:.2g}{unit} (k = 2)")
    return lines
