"""`kolsky material`: parse, call, print; imports beyond typer stay inside the commands."""

from pathlib import Path
from typing import Annotated

import typer

from kolsky.cli.baseline import baseline
from kolsky.cli.shared import AsJson, listed, refusing_bad_input

material = typer.Typer(
    name="material", no_args_is_help=True, help="The quasi-static tests of the material behind a shot."
)
material.command()(baseline)


@material.command()
def fit(
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
    header_line: Annotated[
        int | None, typer.Option(min=0, help="Line of the column names; 0: none.", show_default="found")
    ] = None,
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
    out: Annotated[Path, typer.Option("--out", metavar="FOLDER", help="Where results go.")] = Path(
        "material"
    ),
    figures: Annotated[
        str, typer.Option(metavar="FORMATS", help="Also save each figure alone, e.g. pdf,svg,png.")
    ] = "",
    as_json: AsJson = False,
) -> None:
    """Fit laws to homogeneous tests and compare them: errors, constants, and where each stops being stable.

    Several tests are fitted at once. Writes material.html, material.json and CSV tables.
    """
    with refusing_bad_input():
        from kolsky.cli.work.material import Columns, fit_laws

        fit_laws(
            files,
            columns=Columns(convention, stretch, strain, strain_unit, stress, stress_unit, header_line),
            mean=mean,
            laws=listed(laws),
            weighting=weighting,
            bounded=not free_bounds,
            poisson=poisson,
            starts=starts,
            seed=seed,
            out=out,
            formats=listed(figures),
            as_json=as_json,
        )
