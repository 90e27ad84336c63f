"""`kolsky predict`: a planned test from the striker on."""

from pathlib import Path
from typing import Annotated

import typer

from kolsky.base.errors import InputError
from kolsky.base.options import Option
from kolsky.cli import texts
from kolsky.cli.options import Figures, Film, OutFolder


def predict(
    test: Annotated[Path, typer.Argument(metavar="TEST.toml", help="The test, from striker to specimen.")],
    out: OutFolder,
    vary: Annotated[
        tuple[str, ...],
        Option(
            'Scan a key of the file, e.g. "striker.speed=4 m/s:7 m/s:5"; repeat for more.',
            metavar="KEY=LOW:HIGH[:LEVELS]",
        ),
    ] = (),
    want: Annotated[
        tuple[str, ...],
        Option(
            "Find and predict the point within the ranges that has this number (SI), e.g. flyer_speed=2.7 "
            "or mean_rate=400.",
            metavar="NUMBER=VALUE",
        ),
    ] = (),
    quick: Annotated[bool, Option("Use the specimen's static curve instead of its elements.")] = False,
    film: Film = "",
    figures: Figures = (),
) -> None:
    """Predict a flyer test from the contact of the striker to the second impact.

    Writes prediction.html, prediction.json, and CSV tables of signals, events and the specimen's outline.
    --vary scans the test; --want designs it.
    """
    if film:
        if quick:
            raise InputError(
                texts.COMMAND_LINE, "--film shows the specimen's elements", cure="leave --quick out"
            )
        from kolsky.report.scene.film import writer_for

        cure = "choose another format, or install what it needs"
        with texts.refused(cure, before=f"--film {film}: ", errors=(ImportError,)):
            writer_for(film)
    if want and not vary:
        raise InputError(
            texts.COMMAND_LINE, "--want needs --vary", cure='add e.g. --vary "striker.speed=4 m/s:7 m/s:5"'
        )
    from kolsky.base.files import usable_folder
    from kolsky.cli.terminal import print_result, progress_bars
    from kolsky.prediction import design
    from kolsky.prediction import predict as prediction
    from kolsky.prediction.output import to_json
    from kolsky.report.study_folder import write_prediction_results

    cure = "name a number of the test file with its range, e.g. striker.velocity=2:6"
    with texts.refused(cure, before="--vary: "):
        varied = [design.Varied.of(text) for text in vary]
    wanted = dict(_wanted(text) for text in want)
    folder, planned = usable_folder(out), prediction.read_test(test)
    with progress_bars() as progress:
        scanned = aimed = None
        if varied:
            scanned = design.scan(planned, varied, progress=lambda n, m: progress("design", n, m))
        if scanned is not None and wanted:
            with texts.refused("write it as `kolsky predict --help` shows", before="--want: "):
                aimed = design.aim(planned, scanned, wanted)
            written = {one.key: one.written(aimed.at[one.key]) for one in varied}
            planned = design.varied_test(planned, written)
        progress("simulation", 0, 1)
        found = prediction.predict(planned, quick=quick)
        progress("simulation", 1, 1)
    write_prediction_results(folder, found, scanned, aimed, film=film, formats=figures)
    warnings = prediction.doubts(found)
    if aimed is not None and not aimed.reached:
        bound = f", at a bound of {' and '.join(aimed.at_bound)}" if aimed.at_bound else ""
        warnings.append(
            "the wanted numbers are not reached within the ranges: the nearest point is off by "
            f"{aimed.distance:.1%}{bound}"
        )
    rows = {
        "test": planned.declared.name,
        **({} if aimed is None else {f"found, {key}": value for key, value in aimed.at.items()}),
        **{f"{name}, s": value for name, value in vars(found.events).items()},
        **vars(found.numbers),
        "page": str(folder / "prediction.html"),
    }
    print_result(rows, to_json(found, scanned, aimed), warnings=warnings)


def _wanted(text: str) -> tuple[str, float]:
    """A number and its value, SI."""
    name, _, value = text.partition("=")
    try:
        return name.strip(), float(value)
    except ValueError:
        cure = "write a number in SI units, e.g. flyer_speed=2.7"
        raise InputError(texts.COMMAND_LINE, f"--want {text!r} is not NUMBER=VALUE", cure=cure) from None
