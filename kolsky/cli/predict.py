"""`kolsky predict`: a planned test from the striker on."""

from pathlib import Path
from time import perf_counter
from typing import Annotated

import typer

from kolsky.base.errors import InputError
from kolsky.cli import texts
from kolsky.cli.options import AsJson, Figures, OutFolder


def predict(
    test: Annotated[Path, typer.Argument(metavar="TEST.toml", help="The test: striker to specimen.")],
    out: OutFolder,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            "--vary",
            metavar="KEY=LOW:HIGH[:LEVELS]",
            help='Scan a key of the file, e.g. "striker.speed=4 m/s:7 m/s:5"; repeat for more.',
        ),
    ] = None,
    want: Annotated[
        list[str] | None,
        typer.Option(
            "--want",
            metavar="NUMBER=VALUE",
            help="Find the point of the scan's ranges with this number (SI), e.g. flyer_speed=2.7 or "
            "mean_rate=400; the test is predicted there.",
        ),
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="Let the specimen's static curve stand in for its elements.")
    ] = False,
    film: Annotated[
        str, typer.Option("--film", metavar="FORMAT", help="Also write a film: mp4 or gif.")
    ] = "",
    figures: Figures = "",
    as_json: AsJson = False,
) -> None:
    """Predict a flyer test from the striker's touch to the second impact.

    Writes prediction.html, prediction.json, and CSV tables of signals, events and the specimen's outline.
    With --vary the test is scanned, with --want designed.
    """
    started = perf_counter()
    formats = texts.figure_formats(figures)
    if film:
        texts.one_of("--film", film, ("mp4", "gif"))
        if quick:
            raise InputError(
                texts.COMMAND_LINE, "--film shows the specimen's elements", cure="leave --quick out"
            )
        from kolsky.report.scene.film import writer_for

        try:
            writer_for(film)
        except ImportError as error:
            raise InputError(
                texts.COMMAND_LINE,
                f"--film {film}: {error}",
                cure="choose another ending, or install what it needs",
            ) from None
    if want and not vary:
        raise InputError(
            texts.COMMAND_LINE, "--want needs --vary", cure='add e.g. --vary "striker.speed=4 m/s:7 m/s:5"'
        )
    from kolsky.base.files import usable_folder
    from kolsky.cli.terminal import print_result, progress_bars, since
    from kolsky.prediction import design
    from kolsky.prediction.output import to_json
    from kolsky.prediction.predict import doubts, read_test
    from kolsky.prediction.predict import predict as run
    from kolsky.report.result_folder import write_prediction_results

    try:
        varied = [design.Varied.of(text) for text in vary or []]
    except ValueError as error:
        raise InputError(
            texts.COMMAND_LINE,
            f"--vary: {error}",
            cure="name a number of the test file with its range, e.g. striker.velocity=2:6",
        ) from None
    wanted = dict(_wanted(text) for text in want or [])
    folder, planned = usable_folder(out), read_test(test)
    with progress_bars() as progress:
        scanned = aimed = None
        if varied:
            scanned = design.scan(planned, varied, progress=lambda n, m: progress("design", n, m))
        if scanned is not None and wanted:
            try:
                aimed = design.aim(planned, scanned, wanted)
            except ValueError as error:
                raise InputError(
                    texts.COMMAND_LINE, f"--want: {error}", cure="write it as `kolsky predict --help` shows"
                ) from None
            written = {one.key: one.written(aimed.at[one.key]) for one in varied}
            planned = design.varied_test(planned, written)
        progress("simulation", 0, 1)
        found = run(planned, quick=quick)
        progress("simulation", 1, 1)
    write_prediction_results(folder, found, scanned, aimed, film=film, formats=formats)
    said = to_json(found, scanned, aimed)
    warnings = doubts(found)
    if aimed is not None and not aimed.reached:
        bound = f", at a bound of {' and '.join(aimed.at_bound)}" if aimed.at_bound else ""
        warnings.append(
            "what is wanted is not reached within the ranges: the nearest point is off by "
            f"{aimed.distance:.1%}{bound}"
        )
    rows = {
        "test": planned.declared.name,
        **({} if aimed is None else {f"found, {key}": value for key, value in aimed.at.items()}),
        **{f"{name}, s": value for name, value in vars(found.events).items()},
        **vars(found.numbers),
        "page": str(folder / "prediction.html"),
    }
    print_result(rows, said if as_json else None, rest={"wall time": since(started)}, warnings=warnings)


def _wanted(text: str) -> tuple[str, float]:
    """A number and its value, SI."""
    name, _, value = text.partition("=")
    try:
        return name.strip(), float(value)
    except ValueError:
        cure = "write a number in SI units, e.g. flyer_speed=2.7"
        raise InputError(texts.COMMAND_LINE, f"--want {text!r} is not NUMBER=VALUE", cure=cure) from None
