"""The record that is needed to repeat a result."""

import platform
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from kolsky.base.apparatus import SLIDING_LAW
from kolsky.inverse.prepared_shot import PreparedShot
from kolsky.shot.recorded import recording_facts
from kolsky.shot.records import Shot


def provenance(shot: Shot, settings: Any, prepared: PreparedShot, *, sliding: bool) -> dict[str, Any]:
    """The record that is needed to repeat a result: hashes, settings, versions, machine class.

    Parameters
    ----------
    shot, prepared
        The shot as loaded, and made ready.
    settings
        The dataclass of settings the result was made with.
    sliding : bool
        Whether Coulomb's law replaced the declared interface, see `kolsky.inverse.forward.Forward.run`.

    Returns
    -------
    dict
        JSON types only. "interface" is what was simulated, "declared_interface" what the shot says.
    """
    packages = {}
    for name in ("kolsky", "warp-lang", "numpy", "scipy"):
        try:
            packages[name] = version(name)
        except PackageNotFoundError:
            packages[name] = "not installed"
    declared = {"faces": shot.interface.faces, "side": shot.interface.side}
    interface = {"faces": SLIDING_LAW, "side": SLIDING_LAW} if sliding else declared
    return {
        "inputs": dict(shot.inputs),
        "settings": _plain(settings),
        "interface": interface,
        **({"declared_interface": declared} if interface != declared else {}),
        "specimen": _plain(shot.specimen),
        **({"specimen_length": _plain(shot.length_by_pictures)} if shot.length_by_pictures else {}),
        "support": shot.support,
        **({"transducer_depth": shot.transducer_depth} if shot.transducer_depth else {}),
        **({"behind": _plain(shot.behind)} if shot.behind else {}),
        **({"flyer_body": _plain(shot.flyer_body)} if shot.flyer_body else {}),
        **({"incident_force": "compared"} if shot.incident else {}),
        "window_s": list(shot.window),
        "checks": prepared.checks,
        "recordings": recording_facts(shot),
        "versions": {**packages, "python": platform.python_version()},
        "machine": platform.machine(),
        "seed": getattr(settings, "seed", None),
    }


def _plain(thing: Any) -> Any:
    """Dataclasses, mappings and tuples as JSON can hold them."""
    if hasattr(thing, "__dataclass_fields__"):
        return {name: _plain(getattr(thing, name)) for name in thing.__dataclass_fields__}
    if isinstance(thing, Mapping):
        return {str(key): _plain(value) for key, value in thing.items()}
    if isinstance(thing, (list, tuple)):
        return [_plain(value) for value in thing]
    return thing
