"""The target that a shot file declares for its calibration pictures."""

from dataclasses import fields, replace
from typing import Any

from kolsky.shot.schema.pictures import TargetSection
from kolsky.shot.schema.reading import TomlFile


def target_of(section: TargetSection, toml: TomlFile) -> tuple[Any, Any]:
    """The target that a file describes, as camera 0 and as camera 1 is to look for it.

    Raises
    ------
    InputError
        If its kind is unknown, a dimension is missing, has no effect or is impossible.
    """
    from dic.calibration import TARGETS

    key = "calibration.target"
    if section.kind not in TARGETS:
        known = ", ".join(f'"{name}"' for name in TARGETS)
        raise toml.error(f"{key}.kind", "is not a known target", allowed=f"one of {known}")
    kind = TARGETS[section.kind]
    wanted = {field.name: field for field in fields(kind)}
    anchors = {"anchors_0", "anchors_1"}
    given = {
        name: value
        for name, value in section.model_dump(exclude={"kind", *anchors}).items()
        if value is not None
    }
    by_hand = [section.anchors_0, section.anchors_1]
    if any(by_hand) and "anchors" not in wanted:
        raise toml.error(
            f"{key}.anchors_0" if section.anchors_0 else f"{key}.anchors_1",
            f"is given, but a target of kind {section.kind} needs no anchors",
            cure="remove it",
        )
    for name in given:
        if name not in wanted:
            raise toml.error(
                f"{key}.{name}",
                f"is given, but a target of kind {section.kind} has no such dimension",
                cure=f"remove it; the keys are {', '.join(wanted)}",
            )
    try:
        target = kind(**given)
        if "anchors" not in wanted:
            return target, target
        return replace(target, anchors=by_hand[0] or ()), replace(target, anchors=by_hand[1] or ())
    except TypeError:
        missing = [name for name in wanted if name not in given]
        raise toml.error(f"{key}.kind", f"needs more: some of {', '.join(missing)}") from None
    except ValueError as error:
        raise toml.error(key, f"is impossible: {error}") from None
