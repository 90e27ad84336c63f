"""TOML schemas of a shot (shot.toml) and of image correlation alone (dic.toml), in SI; a problem names its
line and cure."""
