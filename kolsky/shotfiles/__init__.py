"""shot.toml: the tables that may stand in it, in SI once read; a problem names its line and its cure."""

from kolsky.shotfiles.reading import ShotToml, TomlFile, read_declared, read_shot_toml
from kolsky.shotfiles.schema import ShotFile

__all__ = ["ShotFile", "ShotToml", "TomlFile", "read_declared", "read_shot_toml"]
