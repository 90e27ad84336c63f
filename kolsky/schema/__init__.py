"""TOML schemas of a shot (shot.toml) and of image correlation without a shot (dic.toml), in SI.

Errors name the line and the remedy.
"""
