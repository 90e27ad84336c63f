"""A shot: one test, its apparatus and its measurements, loaded from a folder and checked."""

from kolsky.shots.find import find_shot_file, folder_of
from kolsky.shots.load import check_shot, load_pictures, load_shot
from kolsky.shots.shot import ForceChannel, Measured, ModelSettings, PicturedShot, Shot, ShotBase

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
