"""`kolsky predict`: a planned test from the striker on."""

from pathlib import Path
from typing import Annotated

import typer

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

    Writes prediction.html, prediction.json, CSV tables of signals, events and the specimen's outline, and
    virtual.toml for `kolsky virtual make`.
    --vary scans the test; --want designs it.
    """
    if film:
        if quick:
            raise texts.refusal("--film shows the specimen's elements", cure="leave --quick out")
        from kolsky.report.scene.film import writer_for

        cure = "choose another format, or install what it needs"
        with texts.refused(f"--film {film}: ", cure=cure, errors=(ImportError,)):
            writer_for(film)
    if want and not vary:
        raise texts.refusal("--want needs --vary", cure='add e.g. --vary "striker.speed=4 m/s:7 m/s:5"')
    from kolsky.base.files import usable_folder
    from kolsky.cli.terminal import print_result, progress_bars
    from kolsky.prediction import design
    from kolsky.prediction import predict as prediction
    from kolsky.prediction.output import to_json
    from kolsky.report.result_folder import write_prediction_results

    cure = "name a number of the test file with its range, e.g. striker.velocity=2:6"
    with texts.refused("--vary: ", cure=cure):
        ranges = [design.Varied.of(text) for text in vary]
    targets = dict(_wanted(text) for text in want)
    folder, test_plan = usable_folder(out), prediction.read_test(test)
    with progress_bars() as progress:
        scan = aim = None
        if ranges:
            scan = design.scan(test_plan, ranges, progress=lambda n, m: progress("design", n, m))
        if scan is not None and targets:
            with texts.refused("--want: ", cure="write it as `kolsky predict --help` shows"):
                aim = design.aim(test_plan, scan, targets)
            values = {one.key: one.written(aim.at[one.key]) for one in ranges}
            test_plan = design.varied_test(test_plan, values)
        progress("simulation", 0, 1)
        result = prediction.predict(test_plan, quick=quick)
        progress("simulation", 1, 1)
    write_prediction_results(folder, result, scan, aim, film=film, formats=figures)
    warnings = prediction.doubts(result)
    if aim is not None and not aim.reached:
        bound = f", at a bound of {' and '.join(aim.at_bound)}" if aim.at_bound else ""
        warnings.append(
            "the wanted numbers are not reached within the ranges: the nearest point is off by "
            f"{aim.distance:.1%}{bound}"
        )
    rows = {
        "test": test_plan.declared.name,
        **({} if aim is None else {f"found, {key}": value for key, value in aim.at.items()}),
        **{f"{name}, s": value for name, value in vars(result.events).items()},
        **vars(result.numbers),
        "page": str(folder / "prediction.html"),
    }
    print_result(rows, to_json(result, scan, aim), warnings=warnings)


def _wanted(text: str) -> tuple[str, float]:
    """A number and its value, SI."""
    name, _, value = text.partition("=")
    try:
        return name.strip(), float(value)
    except ValueError:
        cure = "write a number in SI units, e.g. flyer_speed=2.7"
        raise texts.refusal(f"--want {text!r} is not NUMBER=VALUE", cure=cure) from None
