"""`kolsky material fit`: laws fitted to homogeneous tests, or to a compressed cylinder with held ends.

Homogeneous tests are fitted point by point; a cylinder with bonded or rough ends by inverse finite
elements.
"""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any

import typer

from kolsky.base.errors import InputError
from kolsky.cli import texts
from kolsky.cli.options import AsJson, Figures, HeaderLine, OutFolder

if TYPE_CHECKING:
    from kolsky.base.apparatus import Specimen
    from kolsky.material.end_friction.problem import ModelFit
    from kolsky.material.fits.compare import Comparison
    from kolsky.material.fits.homogeneous import Mode
    from kolsky.material.fits.homogeneous_test import Columns, HomogeneousTest


_DEFAULT_LAWS = ("neo_hookean", "reduced_polynomial", "yeoh", "mooney_rivlin_2", "ogden1")
"""Laws that are tried if none is named: those that a single compression test may determine."""

_SAME_SIZE = 1e-3
"""Relative difference up to which two sizes of one specimen are the same, written with fewer digits [-]."""


def size_of(text: str) -> "Specimen":
    """ "9.5 mm x 6.5 mm" as the undeformed size of a cylinder."""
    from kolsky.base.apparatus import Specimen

    diameter, cross, length = text.partition(" x ")
    if not cross:
        raise InputError(
            texts.COMMAND_LINE, f"--specimen {text!r} cannot be read", cure='write "9.5 mm x 6.5 mm"'
        )
    return Specimen(
        diameter=texts.physical("--specimen", diameter, "m", positive=True),
        length=texts.physical("--specimen", length, "m", positive=True),
        density=0.0,
    )


def agreed_size(
    size: "Specimen", length: float | None, area: float | None, unused: dict[str, bool]
) -> tuple[float, float]:
    """Length [m] and cross-section [m^2] of the tests: the cylinder's, which others must agree with."""
    for option, mine, own, unit in (
        ("--length", length, size.length, "m"),
        ("--area or --diameter", area, size.area, "m^2"),
    ):
        if mine is not None and abs(mine / own - 1.0) > _SAME_SIZE:
            raise InputError(
                texts.COMMAND_LINE,
                f"{option} gives {mine:.6g} {unit}, --specimen {own:.6g} {unit}",
                cure=f"leave {option} out: the size of --specimen is taken",
            )
    given = [name for name, used in unused.items() if used]
    if given:
        raise InputError(
            texts.COMMAND_LINE,
            f"{', '.join(given)} does not go with --specimen",
            cure="leave it out: repeats are averaged, all laws start from one curve and are free of bounds",
        )
    return size.length, size.area


def _fit_cylinder_with_friction(
    tests: Sequence["HomogeneousTest"],
    *,
    size: "Specimen",
    ends: str,
    laws: tuple[str, ...],
    poisson: float | None,
    hashes: dict[str, str],
    folder: Path,
    as_json: bool,
) -> None:
    """Fit laws to repeats of one compression test with held or rubbing ends; write and print the constants.

    The tests are apparent nominal stresses, tension-positive.
    """
    import numpy as np

    from kolsky.base.files import filling, write_table
    from kolsky.cli.material_curves import ends_of
    from kolsky.cli.terminal import print_result
    from kolsky.material.end_friction.correct import fit_specimen
    from kolsky.material.end_friction.problem import CorrectionNumerics
    from kolsky.material.fits.homogeneous import Mode
    from kolsky.material.reference_curve import Treatment, model_summary, reference_curve
    from kolsky.material.uniaxial import UniaxialTest

    held = ends_of(ends, 0.0)
    if held is None or ends == "free":
        raise InputError(
            texts.COMMAND_LINE, "--specimen needs --ends", cure="write bonded, rough or Coulomb's coefficient"
        )
    for test in tests:
        if test.mode is not Mode.UNIAXIAL or test.strain.min() > -1e-9:
            raise InputError(texts.COMMAND_LINE, f"{test.name} is no compression test", cure="leave it out")
    pushed = [UniaxialTest(t.name, -t.strain, -t.stress, compression=True) for t in tests]
    try:
        mean = reference_curve(pushed, Treatment(points=40))
        found = fit_specimen(
            mean.band,
            size,
            held,
            laws or _DEFAULT_LAWS,
            numerics=CorrectionNumerics(poisson=0.499 if poisson is None else poisson),
        )
    except ValueError as error:
        raise InputError(
            texts.COMMAND_LINE, str(error), cure="correct the option; `--help` shows each with its unit"
        ) from error
    said: dict[str, Any] = {"inputs": hashes, "ends": ends, "laws": [model_summary(one) for one in found]}
    fitted = [one for one in found if not one.reason]
    with filling(folder) as partial:
        (partial / "specimen.json").write_text(
            json.dumps(said, indent=2, allow_nan=False) + "\n", encoding="utf-8"
        )
        write_table(partial / "specimen_constants.csv", _constant_words(fitted))
        curves: dict[str, list[Any]] = {
            "nominal strain (1)": mean.band.strain.tolist(),
            "apparent nominal stress (Pa)": mean.band.stress.tolist(),
        }
        curves |= {f"{one.name} without end friction (Pa)": np.asarray(one.stress).tolist() for one in fitted}
        write_table(partial / "specimen_curves.csv", curves)
    print_result(
        {},
        said if as_json else None,
        answers=_cylinder_lines(fitted),
        rest={"constants": folder / "specimen_constants.csv"},
        warnings=[*mean.remarks, *(f"{one.name} has no fit: {one.reason}" for one in found if one.reason)],
    )


def _constant_words(fitted: Sequence["ModelFit"]) -> dict[str, list[Any]]:
    rows = [(one, name) for one in fitted for name in one.constants]
    return {
        "law": [one.name for one, _ in rows],
        "constant": [name for _, name in rows],
        "value (SI)": [one.constants[name] for one, name in rows],
        "u (SI)": [one.sigma[name] for one, name in rows],
        "weight of the law": [one.weight for one, _ in rows],
        "misfit (rms)": [one.misfit for one, _ in rows],
    }


def _cylinder_lines(fitted: Sequence["ModelFit"]) -> list[str]:
    """Laws with their constants and the strongest correlation, for a terminal."""
    import numpy as np

    lines = []
    for one in fitted:
        lines.append(f"{one.name}: {100.0 * one.misfit:.2g} % from the test (rms), weight {one.weight:.2g}")
        for name, value in one.constants.items():
            lines.append(f"  {name} = {value:.5g} ± {2.0 * one.sigma[name]:.2g} (SI, k = 2)")
        off = np.abs(np.triu(one.correlation, 1))
        if off.size > 1 and off.max() > 0.0:
            i, j = np.unravel_index(int(np.argmax(off)), off.shape)
            names = list(one.constants)
            lines.append(f"  correlation of {names[i]} and {names[j]}: {one.correlation[i, j]:+.3f}")
    return lines


_AREAS = {"mm^2": 1e-6, "cm^2": 1e-4, "m^2": 1.0}
"""Units of a cross-section [m^2]."""


def poisson_of(text: str | None, lateral: str) -> tuple[float | None, bool]:
    """ "0.44" as a ratio, "free" as one that is fitted."""
    if text is None:
        return None, False
    if text == "free":
        if not lateral:
            raise InputError(texts.COMMAND_LINE, "--poisson free needs --lateral", cure="name its column")
        return None, True
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not 0.0 <= value <= 0.49999:
        raise InputError(
            texts.COMMAND_LINE, "is no ratio", key="--poisson", value=text, allowed="0 to 0.49999, or free"
        )
    return value, False


def area_of(area: str | None, diameter: str | None) -> float | None:
    """Cross-section [m^2] by itself or by its diameter."""
    from math import pi

    if area is not None and diameter is not None:
        raise InputError(texts.COMMAND_LINE, "--area and --diameter exclude each other", cure="leave one out")
    if diameter is not None:
        return 0.25 * pi * texts.physical("--diameter", diameter, "m", positive=True) ** 2
    if area is None:
        return None
    number, _, unit = area.strip().partition(" ")
    if unit not in _AREAS:
        raise InputError(
            texts.COMMAND_LINE, f"--area {area!r} cannot be read", cure="write a number and mm^2, cm^2 or m^2"
        )
    return texts.physical("--area", number, "1", positive=True) * _AREAS[unit]


def read_tests(
    files: Sequence[str], columns: "Columns", *, mean: int = 0
) -> "tuple[tuple[HomogeneousTest, ...], dict[str, str]]":
    """The tests, and the hashes of their files by path.

    ``files``: "MODE:FILE", or a file of a uniaxial test. ``columns``: what is said of the files. ``mean``:
    strains at which the files of a mode are averaged; 0 keeps each as a test with all its points. Raises
    InputError if a file cannot be read, what is said of it is not enough, or it holds no such test.
    """
    from kolsky.material.fits.homogeneous_test import (
        means_by_mode,
        read_homogeneous_test,
        with_table_headings,
        with_unique_names,
    )

    hashes: dict[str, str] = {}
    tests: list[HomogeneousTest] = []
    for text in files:
        mode, path = _mode_and_path(text)
        there = with_table_headings(path, columns)
        _refuse_columns(path, mode, there)
        test, hashes[str(path)] = read_homogeneous_test(path, there, mode=mode)
        tests.append(test)
    if mean:
        try:
            tests = means_by_mode(tests, mean)
        except ValueError as error:
            raise InputError(
                texts.COMMAND_LINE, f"--mean: {error}", cure="give two files or more of one kind of test"
            ) from None
    return with_unique_names(tests), hashes


def _mode_and_path(text: str) -> "tuple[Mode, Path]":
    """ "planar:FILE" as a mode and a file; a file alone is uniaxial."""
    from kolsky.material.fits.homogeneous import Mode, mode_named

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
    from kolsky.material.fits.homogeneous import Mode
    from kolsky.material.fits.homogeneous_test import CONVENTIONS
    from kolsky.readers.contents import Layout
    from kolsky.readers.measured_tables import column_names

    texts.one_of("--convention", columns.convention, CONVENTIONS)
    if columns.stretch and columns.strain:
        raise InputError(
            texts.COMMAND_LINE, "--stretch and --strain exclude each other", cure="leave one out"
        )
    if (columns.force != "") != (columns.displacement != ""):
        raise InputError(texts.COMMAND_LINE, "--force and --displacement belong together", cure="name both")
    if columns.force:
        if mode is not Mode.UNIAXIAL or columns.area is None or columns.length is None:
            raise InputError(
                texts.COMMAND_LINE,
                f"{path}: --force and --displacement are of uniaxial tests; they need --length, and --area or"
                " --diameter",
                cure="give the specimen's undeformed size",
            )
        return
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


@dataclass(frozen=True)
class ColumnOptions:
    """Columns of homogeneous tests and the specimen's size; see `kolsky.cli.options.with_settings`."""

    convention: Annotated[
        str,
        typer.Option(
            help="Sign of stress and strain in the files: tension-positive or compression-positive.",
            show_default="required",
        ),
    ] = ""
    stretch: Annotated[str, typer.Option(metavar="COLUMN", help="The stretch, by name or number.")] = ""
    strain: Annotated[
        str, typer.Option(metavar="COLUMN", help="Instead: the nominal strain, or the amount of shear.")
    ] = ""
    strain_unit: Annotated[str | None, typer.Option(help='Its unit, "1" or "%".', show_default="found")] = (
        None
    )
    stress: Annotated[str, typer.Option(metavar="COLUMN", help="The nominal stress.")] = ""
    stress_unit: Annotated[str | None, typer.Option(help='Its unit, e.g. "kPa".', show_default="found")] = (
        None
    )
    displacement: Annotated[
        str, typer.Option(metavar="COLUMN", help="Instead of a strain, uniaxial tests; needs --length.")
    ] = ""
    force: Annotated[
        str, typer.Option(metavar="COLUMN", help="Instead of a stress; needs --area or --diameter.")
    ] = ""
    length: Annotated[str | None, typer.Option(help='Undeformed gauge length, e.g. "30 mm".')] = None
    area: Annotated[str | None, typer.Option(help='Undeformed cross-section, e.g. "12 mm^2".')] = None
    diameter: Annotated[str | None, typer.Option(help='Or the diameter, e.g. "50 mm".')] = None
    lateral: Annotated[
        str,
        typer.Option(
            metavar="COLUMN", help="The stretch across the load, or with --lateral-strain its strain."
        ),
    ] = ""
    lateral_strain: Annotated[
        bool, typer.Option("--lateral-strain", help="The lateral column is a nominal strain.")
    ] = False
    header_line: HeaderLine = None

    def columns(self) -> "Columns":
        """The columns, with the size in SI units.

        Raises InputError if a size cannot be read.
        """
        from kolsky.material.fits.homogeneous_test import Columns

        given = asdict(self)
        diameter = given.pop("diameter")
        if self.length is not None:
            given["length"] = texts.physical("--length", self.length, "m", positive=True)
        given["area"] = area_of(self.area, diameter)
        return Columns(**given)


def material_fit(
    files: Annotated[
        list[str],
        typer.Argument(
            metavar="MODE:FILE...",
            help="Tests of one material: uniaxial:FILE, equibiaxial:FILE, planar:FILE or simple-shear:FILE "
            "(a FILE alone is uniaxial).",
        ),
    ],
    *,
    columns: ColumnOptions,
    mean: Annotated[
        int,
        typer.Option(
            min=0, help="Average the files of a mode at this number of strains; 0: fit every point."
        ),
    ] = 0,
    laws: Annotated[str, typer.Option(metavar="NAMES", help="Laws to try.", show_default="all")] = "",
    weighting: Annotated[str, typer.Option(help="absolute, relative or sigma.")] = "absolute",
    free_bounds: Annotated[
        bool,
        typer.Option("--free-bounds", help="Allow constants with which an energy can become negative."),
    ] = False,
    poisson: Annotated[
        str | None,
        typer.Option(
            help="Poisson's ratio at rest, or free (with --lateral).", show_default="incompressible"
        ),
    ] = None,
    specimen: Annotated[
        str | None,
        typer.Option(
            metavar="DIAMETER x LENGTH",
            help='Inverse finite elements on a compressed cylinder, e.g. "9.5 mm x 6.5 mm"; needs --ends.',
        ),
    ] = None,
    ends: Annotated[
        str, typer.Option(help="What held its ends: bonded, rough, or Coulomb's coefficient.")
    ] = "",
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
    from kolsky.material.fits.search import Weighting
    from kolsky.material.fits.tables import as_json as to_json
    from kolsky.material.fits.tables import remarks, tables

    texts.one_of("--weighting", weighting, tuple(kind.value for kind in Weighting))
    try:
        tried = candidates(texts.listed(laws))
    except ValueError as error:
        raise InputError(
            texts.COMMAND_LINE, f"--laws: {error}", cure="`kolsky material fit --help` lists the laws"
        ) from None
    folder = usable_folder(out)
    ratio, free_poisson = poisson_of(poisson, columns.lateral)
    chosen, size = columns.columns(), None
    if specimen is not None:
        size = size_of(specimen)
        length, area = agreed_size(
            size,
            chosen.length,
            chosen.area,
            {
                "--figures": bool(formats),
                "--mean": mean > 0,
                "--weighting": weighting != "absolute",
                "--free-bounds": free_bounds,
                "--poisson free": free_poisson,
                "--lateral": bool(columns.lateral),
            },
        )
        chosen = replace(chosen, length=length, area=area)
    tests, hashes = read_tests(files, chosen, mean=mean)
    if size is not None:
        _fit_cylinder_with_friction(
            tests,
            size=size,
            ends=ends,
            laws=texts.listed(laws),
            poisson=ratio,
            hashes=hashes,
            folder=folder,
            as_json=as_json,
        )
        return
    if ends:
        raise InputError(texts.COMMAND_LINE, "--ends goes with --specimen", cure="give the cylinder's size")
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
            poisson=ratio,
            free_poisson=free_poisson,
            starts=starts,
            seed=seed,
            progress=lambda done: progress("laws", done, len(tried)),
        )
    if all(row.fit is None for row in found.rows):
        reasons = "; ".join(row.reason for row in found.rows)
        raise InputError(
            texts.COMMAND_LINE,
            f"no law can be fitted: {reasons}",
            cure="give more points or more kinds of test",
        )
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
        doubtful = f.outcome in (FitOutcome.NOT_DETERMINED, FitOutcome.UNCONFIRMED)
        mark = "*" if row is best else "?" if doubtful else " "
        lines.append(
            f"{mark} {row.candidate.name:<19}{1e-3 * f.youngs_modulus:>9.4g}{1e-3 * f.rmse:>11.4g}"
            f"{f.r_squared:>9.5f}{f.aic:>9.1f}  {failure(row)}"
        )
    lines.append("* least BIC of those determined and stable over the data; ? not determined or confirmed")
    if best is not None and best.fit is not None:
        for spec in best.fit.law.PARAMETERS:
            if spec.name in best.fit.free:
                value, u = best.fit.values[spec.name], best.fit.sigma[spec.name]
                unit = "" if spec.unit == "1" else f" {spec.unit}"
                lines.append(f"  {spec.name} = {value:.5g} ± {2.0 * u:.2g}{unit} (k = 2)")
        f = best.fit
        if f.poisson is not None:
            half = f" ± {2.0 * f.sigma['poisson']:.2g} (k = 2)" if "poisson" in f.free else ""
            lines.append(
                f"  Poisson's ratio {f.poisson:.4g}{half}, K = {f.bulk_modulus:.4g} Pa, D1 = {f.D1:.4g} 1/Pa"
            )
    return lines
