"""A shot: one test, its apparatus and its measurements, loaded from a folder and checked."""

from kolsky.shots.load import (
    ForceChannel,
    Measured,
    ModelSettings,
    PicturedShot,
    Shot,
    ShotBase,
    check_shot,
    find_shot_file,
    folder_of,
    load_pictures,
    load_shot,
)

__all__ = [
    "ForceChannel",
    "Measured",
    "ModelSettings",
    "PicturedShot",
    "Shot",
    "ShotBase",
    "check_shot",
    "find_shot_file",
    "folder_of",
    "load_pictures",
    "load_shot",
]
