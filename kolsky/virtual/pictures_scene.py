"""What the cameras of a made shot see: specimen, flyer and transmission platen with their paint."""

from dataclasses import replace

import numpy as np
from scipy.interpolate import PchipInterpolator

from dic.synthetic.paint import Paint, flaked, painted, printed_dots, scratched, sprayed_drops
from dic.synthetic.scene import Instants, Lamp, RevolvedBody, Scene, closed, cylinder, exposures
from dic.synthetic.texture import Area, Texture, plain
from kolsky.base.arrays import FloatArray
from kolsky.virtual.records import SurfaceHistory
from kolsky.virtual.schema import Specification
from kolsky.virtual.streams import stream

GRAIN = 0.012
"""Standard deviation of the reflectance of bare material, texel by texel [-]."""
SHARP = 0.05
"""Motion during an exposure that is not resolved [px]; its blur would widen the lens by 4e-4 of a pixel."""


def scene_of(q: Specification, surface: SurfaceHistory, *, shot: int) -> Scene:
    """The scene at the instants of all frames.

    Parameters
    ----------
    q
        The specification.
    surface
        Specimen and flyer at the true times of the frames.
    shot
        Number of the shot.
    """
    instants = instants_of(q, surface)
    at = _at(surface, instants.time)
    reach = _reach(q, surface)
    bodies = (
        _specimen(q, surface, at, instants, reach, shot),
        _flyer(q, at, reach, shot),
        _platen(q, at, reach, shot),
    )
    o = q.optics
    toward = (
        np.sin(o.lamp_side) * np.cos(o.lamp_height),
        np.sin(o.lamp_height),
        np.cos(o.lamp_side) * np.cos(o.lamp_height),
    )
    return Scene(instants, bodies, lamp=Lamp(toward, o.ambient, o.gloss), background=0.05)


def instants_of(q: Specification, surface: SurfaceHistory) -> Instants:
    """Instants of the exposures: one where less than `SHARP` moves, else two and more by the blur."""
    speed = np.abs(np.gradient(surface.displacement, surface.time))
    blur = speed * q.optics.exposure / q.cameras.pixel
    points = np.where(blur > SHARP, 1 + np.maximum(1, np.ceil(blur)), 1).astype(np.int64)
    return exposures(surface.time, q.optics.exposure, points)


class _At:
    """Surface and flyer at the instants."""

    def __init__(self, y: FloatArray, r: FloatArray, flyer: FloatArray, tilt: FloatArray) -> None:
        self.y, self.r, self.flyer, self.tilt = y, r, flyer, tilt


def _at(surface: SurfaceHistory, time: FloatArray) -> _At:
    """Between frames by monotone cubics, which do not ring at the start of the motion."""
    inside = np.clip(time, surface.time[0], None)
    y, r, d, tilt = (
        PchipInterpolator(surface.time, values, axis=0, extrapolate=True)(inside)
        for values in (surface.y, surface.r, surface.displacement, surface.tilt)
    )
    return _At(y, np.maximum(r, 0.0), d, tilt)


def _reach(q: Specification, surface: SurfaceHistory) -> float:
    """Largest distance from the axis, across it, that the pictures show [m], with a margin."""
    c = q.cameras
    across = c.picture[0] if c.along == c.picture[1] and c.flyer_side in ("up", "down") else c.picture[1]
    return abs(c.aside) + (0.5 * across + 0.02 * max(c.sensor)) * c.pixel * 1.1 + 0.2e-3


def _around(radius: float, reach: float) -> tuple[float, float]:
    """Material places around that can come into view of a cylinder [m]: 1.8 rad at the most."""
    angle = 1.8 if reach >= 0.95 * radius else float(np.arcsin(reach / radius)) + 0.3
    return -min(angle, 1.8) * radius, min(angle, 1.8) * radius


def _specimen(
    q: Specification, surface: SurfaceHistory, at: _At, instants: Instants, reach: float, shot: int
) -> RevolvedBody:
    s, pixel = q.speckle, q.cameras.pixel
    radius, length = 0.5 * q.specimen.diameter, q.specimen.length
    area = Area(_around(radius, reach), (-2.0 * pixel, length + 2.0 * pixel))
    rng = stream(q.seed, shot, "damage")
    texture = _paint(q, area, stream(q.seed, shot, "speckles", "specimen"))
    spots = rng.uniform([-0.5, 0.2], [0.5, 0.8], (3, 2)) * [min(radius, reach), length]
    if s.scratch > 0.0:
        lean = rng.uniform(-0.3, 0.3) * length
        start, end = (area.around[0], spots[0, 1] - lean), (area.around[1], spots[0, 1] + lean)
        texture = scratched(texture, start=start, end=end, width=s.scratch, level=s.bare)
    if s.flake > 0.0:
        texture = flaked(texture, middle=tuple(spots[1]), radius=s.flake, level=s.bare, rng=rng)
    y, r, along = closed(at.y, at.r, surface.y[0] - surface.y[0, 0])
    share = at.flyer / max(float(surface.displacement.max()), 1e-12)
    slip = np.zeros((len(instants.time), 2))
    slip[:, 1] = s.loose_slip * np.clip(share, 0.0, 1.0)
    return RevolvedBody(
        y=y, r=r, along=along, radius=radius, texture=texture, shine=q.optics.highlight,
        patch=(*spots[2], s.loose), slip=slip,
    )  # fmt: skip


def _flyer(q: Specification, at: _At, reach: float, shot: int) -> RevolvedBody:
    radius = 0.5 * q.motion.flyer_diameter
    height = max(q.cameras.field, float(at.flyer.max()) + q.cameras.field)
    texture = _covered(q, radius, reach, (0.0, height), q.speckle.flyer, "flyer", shot)
    place = np.zeros((len(at.flyer), 3))
    place[:, 1] = q.specimen.length - at.flyer
    place[:, 2] = -q.imperfections.off_centre
    c, s, zero, one = np.cos(at.tilt), np.sin(at.tilt), np.zeros_like(at.tilt), np.ones_like(at.tilt)
    turn = np.stack([one, zero, zero, zero, c, s, zero, -s, c], axis=1).reshape(-1, 3, 3)
    return cylinder(radius, height, texture, place=place, turn=turn, shine=q.optics.highlight)


def _platen(q: Specification, at: _At, reach: float, shot: int) -> RevolvedBody:
    """The transmission platen: a cylinder that ends at the specimen's first node."""
    radius, height = 0.5 * q.motion.flyer_diameter, q.cameras.field
    texture = _covered(q, radius, reach, (0.0, height), q.speckle.platen, "platen", shot)
    place = np.zeros((len(at.flyer), 3))
    place[:, 1] = at.y[:, 0] - height
    place[:, 2] = -q.imperfections.off_centre
    return cylinder(radius, height, texture, place=place, shine=q.optics.highlight)


def _covered(
    q: Specification,
    radius: float,
    reach: float,
    along: tuple[float, float],
    speckled: bool,
    name: str,
    shot: int,
) -> Texture:
    """Paint or bare material of a rigid body's side; its faces are bare."""
    rim = 2.0 * q.cameras.pixel
    area = Area(_around(radius, reach), (along[0] - rim, along[1] + rim))
    if not speckled:
        seed = int(stream(q.seed, shot, "bare", name).integers(2**32))
        return plain(area, 0.5 * q.cameras.pixel, level=q.speckle.bare, grain=GRAIN, seed=seed)
    texture = _paint(q, area, stream(q.seed, shot, "speckles", name))
    _, v = area.grid(texture.pitch)
    face = (v < along[0] - texture.pitch) | (v > along[1] + texture.pitch)
    grey = np.where(face[:, None], np.float32(q.speckle.bare), texture.grey)
    return replace(texture, grey=grey)


def _paint(q: Specification, area: Area, rng: np.random.Generator) -> Texture:
    """Speckles of the specification; texels as far apart as rays."""
    s, pixel = q.speckle, q.cameras.pixel
    size = s.size * pixel
    if s.kind == "sprayed":
        centres, diameters = sprayed_drops(
            area, size=size, spread=s.size_spread, coverage=s.coverage, rng=rng
        )
    else:
        centres, diameters = printed_dots(area, size=size, coverage=s.coverage, jitter=s.jitter, rng=rng)
    pitch = pixel / q.optics.rays
    return painted(area, pitch, centres, diameters, Paint(s.dark, s.bright, s.softness))
