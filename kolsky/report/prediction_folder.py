"""Result folder of `kolsky predict`."""

import json
from collections.abc import Sequence
from pathlib import Path

from kolsky.base.files import filling
from kolsky.prediction.design import Aim, Scan
from kolsky.prediction.output import to_json, write_tables
from kolsky.prediction.predict import Prediction
from kolsky.report.figures_alone import save_figures_alone


def write_prediction_results(
    folder: Path,
    found: Prediction,
    scan: Scan | None = None,
    aim: Aim | None = None,
    *,
    film: str = "",
    formats: Sequence[str] = (),
) -> None:
    """Write prediction.html, prediction.json, tables, and a film and figures if they are asked for.

    Parameters
    ----------
    folder, formats
        As of `kolsky.report.result_folder.write_identify_results`.
    found
        The prediction.
    scan, aim
        A scan that was made before, and the point found in it.
    film
        Format of a film, "mp4" or "gif"; empty for none.

    Raises
    ------
    InputError
        If the results cannot be written.
    """
    from kolsky.report.figures import SCANS
    from kolsky.report.pages.prediction import write_page

    with filling(folder) as partial:
        write_tables(partial, found, scan)
        text = json.dumps(to_json(found, scan, aim), indent=2, allow_nan=False)
        (partial / "prediction.json").write_text(text, encoding="utf-8")
        write_page(partial / "prediction.html", found, scan, aim)
        save_figures_alone(partial, found, formats)
        if scan is not None:
            save_figures_alone(partial, (scan, aim), formats, registry=SCANS)
        if film:
            from kolsky.report.prediction_film import write_prediction_film

            write_prediction_film(partial / f"prediction.{film}", found)
