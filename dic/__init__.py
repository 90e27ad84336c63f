"""Pictures to surfaces: stereo image correlation with a sigma and an outcome per point.

The names below are loaded when they are first used.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dic.bodies.region import Region
    from dic.calibration.detect import detect
    from dic.calibration.solve import calibrate
    from dic.camera import Camera, StereoRig
    from dic.camera_files.formats import read_rig, write_rig
    from dic.chain.settings import ChainSettings
    from dic.chain.stages import measure
    from dic.correlation.search import correlate
    from dic.correlation.settings import Correlation
    from dic.full_field.extensometers import Extensometer
    from dic.full_field.measure import measure_plane
    from dic.full_field.result import FullField
    from dic.full_field.settings import FullFieldSettings
    from dic.full_field.stereo import measure_cylinder, measure_surface
    from dic.images.formats import open_pictures
    from dic.images.series import Pictures
    from dic.outcome import FrameOutcome, PointOutcome
    from dic.result import StereoResult
    from dic.stereo.match import match_stereo
    from dic.stereo.reconstruction import reconstruct
    from dic.surfaces.strains import StrainGauge, strains
    from dic.surfaces.surface_history import CentrePoints, SurfaceHistory, centre_line
    from dic.tracking.follow import track
    from dic.tracking.settings import Tracking

_HOME = {
    "Camera": "dic.camera",
    "CentrePoints": "dic.surfaces.surface_history",
    "ChainSettings": "dic.chain.settings",
    "Correlation": "dic.correlation.settings",
    "Extensometer": "dic.full_field.extensometers",
    "FrameOutcome": "dic.outcome",
    "FullField": "dic.full_field.result",
    "FullFieldSettings": "dic.full_field.settings",
    "Pictures": "dic.images.series",
    "PointOutcome": "dic.outcome",
    "Region": "dic.bodies.region",
    "StereoResult": "dic.result",
    "StereoRig": "dic.camera",
    "StrainGauge": "dic.surfaces.strains",
    "SurfaceHistory": "dic.surfaces.surface_history",
    "Tracking": "dic.tracking.settings",
    "calibrate": "dic.calibration.solve",
    "centre_line": "dic.surfaces.surface_history",
    "correlate": "dic.correlation.search",
    "detect": "dic.calibration.detect",
    "match_stereo": "dic.stereo.match",
    "measure": "dic.chain.stages",
    "measure_cylinder": "dic.full_field.stereo",
    "measure_plane": "dic.full_field.measure",
    "measure_surface": "dic.full_field.stereo",
    "open_pictures": "dic.images.formats",
    "read_rig": "dic.camera_files.formats",
    "reconstruct": "dic.stereo.reconstruction",
    "strains": "dic.surfaces.strains",
    "track": "dic.tracking.follow",
    "write_rig": "dic.camera_files.formats",
}
"""Module that defines each public name. The imports above tell a type checker the same; a test compares
both."""

__all__ = [*_HOME]


def __getattr__(name: str) -> Any:
    """Load a public name when it is first asked for."""
    if name not in _HOME:
        raise AttributeError(f"module 'dic' has no attribute {name!r}; it offers {', '.join(_HOME)}")
    from importlib import import_module

    value = getattr(import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOME})
