"""Stereo image correlation: from pictures to surfaces, with a sigma and an outcome per point.

The names below are imported at their first use.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dic.bodies.region import Region
    from dic.calibration.solve import calibrate
    from dic.calibration.views import detect
    from dic.camera import Camera, StereoRig
    from dic.camera_files import read_rig, write_rig
    from dic.chain import measure
    from dic.chain.inputs import ChainSettings
    from dic.correlation import correlate
    from dic.correlation.subsets import Correlation
    from dic.full_field.measure import Extensometer, FullFieldSettings, measure_plane
    from dic.full_field.stereo import measure_cylinder, measure_surface
    from dic.images import open_pictures
    from dic.images.series import Pictures
    from dic.outcome import FrameOutcome, PointOutcome
    from dic.result import FullField, StereoResult
    from dic.stereo.match import match_stereo
    from dic.stereo.reconstruction import reconstruct
    from dic.surfaces.strains import StrainGauge, strains
    from dic.surfaces.surface_history import CentrePoints, SurfaceHistory, centre_line
    from dic.tracking import track
    from dic.tracking.inputs import Tracking

_HOME = {
    "Camera": "dic.camera",
    "CentrePoints": "dic.surfaces.surface_history",
    "ChainSettings": "dic.chain.inputs",
    "Correlation": "dic.correlation.subsets",
    "Extensometer": "dic.full_field.measure",
    "FrameOutcome": "dic.outcome",
    "FullField": "dic.result",
    "FullFieldSettings": "dic.full_field.measure",
    "Pictures": "dic.images.series",
    "PointOutcome": "dic.outcome",
    "Region": "dic.bodies.region",
    "StereoResult": "dic.result",
    "StereoRig": "dic.camera",
    "StrainGauge": "dic.surfaces.strains",
    "SurfaceHistory": "dic.surfaces.surface_history",
    "Tracking": "dic.tracking.inputs",
    "calibrate": "dic.calibration.solve",
    "centre_line": "dic.surfaces.surface_history",
    "correlate": "dic.correlation",
    "detect": "dic.calibration.views",
    "match_stereo": "dic.stereo.match",
    "measure": "dic.chain",
    "measure_cylinder": "dic.full_field.stereo",
    "measure_plane": "dic.full_field.measure",
    "measure_surface": "dic.full_field.stereo",
    "open_pictures": "dic.images",
    "read_rig": "dic.camera_files",
    "reconstruct": "dic.stereo.reconstruction",
    "strains": "dic.surfaces.strains",
    "track": "dic.tracking",
    "write_rig": "dic.camera_files",
}
"""Module that defines each public name. The imports above repeat the list for type checkers; a test compares
both."""

__all__ = [*_HOME]


def __getattr__(name: str) -> Any:
    """Import a public name at its first use."""
    if name not in _HOME:
        raise AttributeError(f"module 'dic' has no attribute {name!r}; it offers {', '.join(_HOME)}")
    from importlib import import_module

    value = getattr(import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOME})
