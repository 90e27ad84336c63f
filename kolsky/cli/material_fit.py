"""`kolsky material fit`: laws fitted to homogeneous tests, compared, written and printed."""

import json
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated

import typer

from kolsky.base.errors import InputError
from kolsky.cli import texts
from kolsky.cli.homogeneous_options import area_of, poisson_of, read_tests
from kolsky.cli.options import AsJson, Figures, HeaderLine, OutFolder

if TYPE_CHECKING:
    from kolsky.material.fits.compare import Comparison


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
    displacement: Annotated[
        str, typer.Option(metavar="COLUMN", help="Instead of a strain, uniaxial tests; needs --length.")
    ] = "",
    force: Annotated[
        str, typer.Option(metavar="COLUMN", help="Instead of a stress; needs --area or --diameter.")
    ] = "",
    length: Annotated[str | None, typer.Option(help='Undeformed gauge length, e.g. "30 mm".')] = None,
    area: Annotated[str | None, typer.Option(help='Undeformed cross-section, e.g. "12 mm^2".')] = None,
    diameter: Annotated[str | None, typer.Option(help='Or the diameter, e.g. "50 mm".')] = None,
    lateral: Annotated[
        str,
        typer.Option(
            metavar="COLUMN", help="The stretch across the load, or with --lateral-strain its strain."
        ),
    ] = "",
    lateral_strain: Annotated[
        bool, typer.Option("--lateral-strain", help="The lateral column is a nominal strain.")
    ] = False,
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
    from kolsky.material.fits.homogeneous_files import Columns
    from kolsky.material.fits.residuals import Weighting
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
    ratio, free_poisson = poisson_of(poisson, lateral)
    tested_length = None if length is None else texts.physical("--length", length, "m", positive=True)
    section = area_of(area, diameter)
    size = None
    if specimen is not None:
        from kolsky.cli.held_specimen import agreed_size, fit_held_specimen, size_of

        size = size_of(specimen)
        tested_length, section = agreed_size(
            size,
            tested_length,
            section,
            {
                "--figures": bool(formats),
                "--mean": mean > 0,
                "--weighting": weighting != "absolute",
                "--free-bounds": free_bounds,
                "--poisson free": free_poisson,
                "--lateral": bool(lateral),
            },
        )
    columns = Columns(
        convention,
        stretch,
        strain,
        strain_unit,
        stress,
        stress_unit,
        header_line,
        displacement=displacement,
        force=force,
        length=tested_length,
        area=section,
        lateral=lateral,
        lateral_strain=lateral_strain,
    )
    tests, hashes = read_tests(files, columns, mean=mean)
    if size is not None:
        fit_held_specimen(
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
