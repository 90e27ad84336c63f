"""`kolsky material healing`: healing efficiencies from tensile tests to fracture."""

import math
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from kolsky.base.errors import InputError
from kolsky.base.options import Option
from kolsky.cli import texts
from kolsky.cli.material_fit import poisson_of, read_tests
from kolsky.cli.options import OutFolder
from kolsky.material.fits.columns import Columns

if TYPE_CHECKING:
    from kolsky.material.fits.properties import Healing

TENSILE = Columns(convention="tension-positive")


def material_healing(
    undamaged: Annotated[list[str], Option("Tensile test of an undamaged specimen; repeat.", metavar="FILE")],
    healed: Annotated[list[str], Option("Tensile test of a healed specimen; repeat.", metavar="FILE")],
    *,
    columns: Columns = TENSILE,
    law: Annotated[str, Option("Law whose constants are compared.")] = "neo_hookean",
    poisson: Annotated[
        float | None,
        Option("Poisson's ratio at rest.", metavar="RATIO", show_default="incompressible", read=poisson_of),
    ] = None,
    out: OutFolder = Path("healing"),
) -> None:
    """Healing efficiencies of modulus, constants, fracture stress and strain, with their uncertainties.

    Writes healing.json and healing.csv, and healing_specimens.csv with every specimen's properties.
    """
    from explicit.materials import LAWS
    from kolsky.base.files import filling, usable_folder, write_json, write_table
    from kolsky.cli.terminal import print_result
    from kolsky.material.fits.properties import healing

    texts.one_of("--law", law, tuple(LAWS))
    texts.refuse({"--poisson free": poisson == "free"}, "needs a lateral strain", cure="give a number")
    folder = usable_folder(out)
    groups = [read_tests(files, columns) for files in (undamaged, healed)]
    repeated = set(groups[0][1]) & set(groups[1][1])
    if repeated:
        raise InputError(sorted(repeated)[0], "is named as undamaged and as healed", cure="name it once")
    with texts.refused(cure="correct the option; `kolsky material healing --help` shows each"):
        result = healing(groups[0][0], groups[1][0], law=law, poisson=poisson)
    content = {
        "inputs": {"undamaged": groups[0][1], "healed": groups[1][1]},
        "law": law,
        "properties": {
            name: _json(asdict(row)) | {"unit": result.units[name]} for name, row in result.rows.items()
        },
        "specimens": {
            "undamaged": {one.name: one.values for one in result.undamaged},
            "healed": {one.name: one.values for one in result.healed},
        },
        "remarks": list(result.remarks),
    }
    with filling(folder) as partial:
        write_json(partial / "healing.json", content)
        write_table(partial / "healing.csv", _table(result))
        write_table(partial / "healing_specimens.csv", _specimens(result))
    print_result(
        {},
        content,
        lines=[*groups[0][2], *groups[1][2], *_lines(result)],
        files={"table": folder / "healing.csv"},
        warnings=result.remarks,
    )


def _json(value: Any) -> Any:
    """Numbers for JSON; an unknown one is null."""
    if isinstance(value, dict):
        return {name: _json(part) for name, part in value.items()}
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _table(result: "Healing") -> dict[str, list[Any]]:
    rows = result.rows.items()
    return {
        "property": [name for name, _ in rows],
        "unit": [result.units[name] for name, _ in rows],
        "undamaged": [row.undamaged.value for _, row in rows],
        "u undamaged": [_json(row.undamaged.sigma) for _, row in rows],
        "healed": [row.healed.value for _, row in rows],
        "u healed": [_json(row.healed.sigma) for _, row in rows],
        "healing efficiency (1)": [row.efficiency.value for _, row in rows],
        "u efficiency (1)": [_json(row.efficiency.sigma) for _, row in rows],
    }


def _specimens(result: "Healing") -> dict[str, list[Any]]:
    rows = [
        (group, one.name, name, one.values[name])
        for group, ones in (("undamaged", result.undamaged), ("healed", result.healed))
        for one in ones
        for name in one.values
    ]
    return {
        "group": [row[0] for row in rows],
        "specimen": [row[1] for row in rows],
        "property": [row[2] for row in rows],
        "value (SI)": [row[3] for row in rows],
    }


def _lines(result: "Healing") -> list[str]:
    """The table for a terminal."""
    lines = [f"{'property':<24}{'undamaged':>12}{'healed':>12}  efficiency"]
    for name, row in result.rows.items():
        u = row.efficiency.sigma
        spread = f" ± {200.0 * u:.2g} % (k = 2)" if math.isfinite(u) else " %, scatter unknown"
        lines.append(
            f"{name:<24}{row.undamaged.value:>12.4g}{row.healed.value:>12.4g}"
            f"  {100.0 * row.efficiency.value:.4g}{spread}  [{result.units[name]}]"
        )
    return lines
