"""Warp's devices, without its banner."""

from typing import Any

import warp as wp


def select_device(name: str) -> Any:
    """Start Warp quietly and return a device.

    Raises
    ------
    ValueError
        If the machine has no such device; the message lists those it has.
    """
    wp.config.log_level = wp.LOG_ERROR
    wp.init()
    known = {"cpu"} | {device.alias for device in wp.get_cuda_devices()}
    alias = "cuda:0" if name == "cuda" else name
    if alias not in known:
        raise ValueError(f"device must be one of {sorted(known)}, got {name!r}")
    return wp.get_device(alias)
