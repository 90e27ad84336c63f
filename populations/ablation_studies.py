"""Effect of each mechanism in studies that switch it off themselves.

    python -m populations.ablation_studies FOLDER ... [--table FILE.json]

Each folder is one study of `populations.coverage` or `populations.joint_coverage` with another `--off`. The
table is that of `populations.ablation`.
"""

import argparse
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from populations.ablation import table
from populations.coverage import ANSWERS, called_identified
from populations.driver import write


def rows_of(folder: Path) -> Iterator[dict[str, Any]]:
    """The answers of a study, as `populations.ablation.table` takes them."""
    off = json.loads((folder / "study.json").read_text("utf-8"))["off"]
    for path in sorted(path for path in folder.glob("*.json") if path.stem[-1].isdigit()):
        one = json.loads(path.read_text("utf-8"))
        yield {"shot": str(one["number"]), "switch": off} | (joint(one) if "found" in one else single(one))


def single(one: dict[str, Any]) -> dict[str, Any]:
    """Row of an answer of `populations.coverage`."""
    if "updates" not in one:
        return {"broke": one["outcome"]}
    said = {
        name: {"value": one["value"][name], "sigma": one["sigma"][name], "truth": true}
        for name, true in one["truth"].items()
    }
    return {"updates": one["updates"], "said": said, "identified": called_identified(one)}


def joint(one: dict[str, Any]) -> dict[str, Any]:
    """Row of an answer of `populations.joint_coverage`."""
    if one["found"] is None:
        return {"broke": one["error"]}
    estimates = one["found"]["estimates"]
    said = {
        name: {"value": estimates[name]["value"], "sigma": estimates[name]["sigma"], "truth": true}
        for name, true in one["truth"].items()
    }
    identified = all(estimate["outcome"] in ANSWERS for estimate in estimates.values())
    return {"updates": one["updates"], "said": said, "identified": identified}


def main() -> None:
    """Read the studies, print and store the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folders", type=Path, nargs="+", metavar="FOLDER")
    parser.add_argument("--table", type=Path, help="where the answers are written, as JSON")
    given = parser.parse_args()
    studies = [json.loads((folder / "study.json").read_text("utf-8")) for folder in given.folders]
    others = [{key: study[key] for key in study if key != "off" and "device" not in key} for study in studies]
    if any(other != others[0] for other in others):
        raise SystemExit("the folders are of different studies: all settings except --off must be equal")
    rows = [row for folder in given.folders for row in rows_of(folder)]
    if given.table is not None:
        write(given.table, {**others[0], "each": rows}, indent=1)
    print(table(rows))


if __name__ == "__main__":
    main()
