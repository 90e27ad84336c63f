"""The specimen's length as declared, in the pictures and used: in the terminal, the file, JSON and page."""

from dataclasses import asdict, replace
from pathlib import Path

from synthetic import synthetic

from kolsky.pictures.specimen_length import RimAtRest, conditioned_length
from kolsky.report.pages.identification import render
from kolsky.results import printed
from kolsky.results.hdf5 import read_identification, write_identification
from kolsky.results.tables import to_json

LENGTH = conditioned_length(RimAtRest(8e-6, 6e-6), declared=6e-3, sigma=8e-6, y_sigma=0.0)


def test_it_is_said_everywhere_and_survives_the_file(tmp_path: Path) -> None:
    plain = synthetic()
    assert "specimen's length" not in printed.details(plain)
    found = replace(plain, provenance={**plain.provenance, "specimen_length": asdict(LENGTH)})
    write_identification(tmp_path / "identification.h5", found)
    again = read_identification(tmp_path / "identification.h5")
    assert printed.details(again)["specimen's length"] == (
        "declared 6.0000 mm ± 16.0 um, in the pictures 6.0080 mm ± 12.0 um, used 6.0051 mm ± 9.6 um (k = 2)"
    )
    said = to_json(again)["provenance"]["specimen_length"]
    assert (said["declared"], said["pictures"], said["used"]) == (6e-3, LENGTH.pictures, LENGTH.used)
    page = render(again)
    for words, value in (("length, declared", "6 mm"), ("length in the pictures", "6.008 mm")):
        assert words in page
        assert value in page
