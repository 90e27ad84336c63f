"""shot.toml: the tables that may stand in it, in SI once read; a problem names its line and its cure."""
