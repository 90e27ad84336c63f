"""The options of `kolsky material reference-curve` that are more than one word or number."""

from typing import TYPE_CHECKING

from kolsky.base.errors import InputError
from kolsky.cli import texts

if TYPE_CHECKING:
    from kolsky.base.apparatus import Specimen
    from kolsky.material.curves.uniaxial import Toe
    from kolsky.material.end_friction.problem import EndFriction


def specimen_of(diameter: str | None, length: str | None) -> "Specimen | None":
    """Undeformed size of the specimen, if it is given."""
    from kolsky.base.apparatus import Specimen

    if diameter is None and length is None:
        return None
    if diameter is None or length is None:
        raise InputError(
            texts.COMMAND_LINE,
            "needs both --diameter and --length or neither",
            cure="give both, or leave both out",
        )
    return Specimen(
        diameter=texts.physical("--diameter", diameter, "m", positive=True),
        length=texts.physical("--length", length, "m", positive=True),
        density=0.0,
    )


def refuse_columns(columns: dict[str, str], size: "Specimen | None") -> None:
    """Refuse columns that make no test."""
    pair = {"strain", "stress"} if "stress" in columns else {"displacement", "force"}
    if (set(columns) & {"strain", "stress", "displacement", "force"}) != pair:
        raise InputError(
            texts.COMMAND_LINE,
            "a test needs --strain and --stress, or --displacement and --force",
            cure="name two columns, or give their numbers",
        )
    if "force" in pair and size is None:
        raise InputError(
            texts.COMMAND_LINE,
            "--displacement and --force need --diameter and --length",
            cure="give the size of the specimen",
        )


def ends_of(text: str, sigma: float) -> "EndFriction | None":
    """ "bonded" or "0.3" as what held the specimen at its ends."""
    from kolsky.material.end_friction.problem import EndFriction

    number = None
    if text not in ("none", "bonded", "rough", "free"):
        try:
            number = float(text)
        except ValueError:
            texts.one_of("--friction", text, ("none", "bonded", "rough", "free", "a number"))
    if number is None and sigma > 0.0:
        raise InputError(
            texts.COMMAND_LINE,
            "--friction-sigma goes with a number as --friction",
            cure="give --friction NUMBER, or leave --friction-sigma out",
        )
    if text == "none":
        return None
    if text in ("bonded", "rough"):
        return EndFriction("bonded" if text == "bonded" else "rough")
    return EndFriction("coulomb", number, sigma)


def toe_of(text: str) -> "Toe":
    """ "gaussian:0.03:0.12" as a toe."""
    from kolsky.material.curves.uniaxial import Toe

    if text == "none":
        return Toe()
    kind, *ends = text.split(":")
    try:
        if kind not in ("line", "gaussian") or len(ends) != 2:
            raise ValueError
        low, high = (float(end) for end in ends)
    except ValueError:
        raise InputError(
            texts.COMMAND_LINE,
            f"--toe {text!r} cannot be read",
            cure="write none, or line:LOW:HIGH or gaussian:LOW:HIGH with strains, e.g. gaussian:0.03:0.12",
        ) from None
    return Toe("line" if kind == "line" else "gaussian", low, high)


def units_of(given: list[str], columns: dict[str, str]) -> dict[str, str]:
    """["Load=N"] as units by column."""
    found = {}
    for text in given:
        column, equals, unit = text.rpartition("=")
        if not equals or column not in columns.values():
            raise InputError(
                texts.COMMAND_LINE,
                f"--unit {text!r} names no column that is read",
                cure="write COLUMN=UNIT",
            )
        found[column] = unit
    return found
