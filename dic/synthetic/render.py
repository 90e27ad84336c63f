"""Pictures of a scene: ray casting, grey values of the sensor, and camera file formats."""

import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import tifffile
from numpy.typing import NDArray

from dic.basics import FloatArray, cv2
from dic.camera import Camera
from dic.correlation.kernels.device import select_device
from dic.files import replacing
from dic.synthetic.kernels.launch import frames, rays_of_board, rays_of_bodies, upload_bodies, upload_view
from dic.synthetic.scene import Lamp, Lens, RevolvedBody, Scene, weight_table

Light = NDArray[np.float32]
"""Light on the pixels; 1 is fully lit white paint, shape [n_frames, rows, columns]."""

WIDEST = 10.0
"""Largest allowed standard deviation of the point spread of a lens out of focus [px]."""


def picture_series(
    scene: Scene,
    camera: Camera,
    shape: tuple[int, int],
    *,
    lens: Lens | None = None,
    haze: NDArray[np.float32] | None = None,
    haze_pitch: float = 1.0,
    device: str = "cpu",
    threads: int = 1,
) -> Iterator[Light]:
    """Light on the pixels of one camera, in blocks of a few frames.

    The distortion of the lens is removed from every ray. A body is a polyline rotated about an axis. Its
    intersection with a ray has a closed form. At the nearest intersection the body's texture is read. The
    light on a pixel is the integral of the rays over its square, blurred by the lens.

    ``scene``: bodies at the instants of the frames. ``shape``: rows and columns [px]. ``lens``: point spread
    and rays per pixel; default `Lens()`. ``haze``: displacements of the picture by the air [px], from
    `dic.synthetic.scene.haze`; None: none. ``haze_pitch``: distance between its nodes [px]. ``device``: "cpu"
    or a GPU, "cuda:0". Yields: the next frames, in their order.
    """
    lens = lens or Lens()
    start = select_device(device)
    bodies = upload_bodies(scene.bodies, len(scene.instants.time), camera, start)
    weights, pad = _weights(camera, lens, _depths(scene, camera))
    view = upload_view(camera, shape, pad, lens, scene.lamp, scene.background, haze, haze_pitch, start)
    rays = rays_of_bodies(view, bodies, scene.instants, start)
    yield from frames(rays, view, weights, shape, scene.instants.n_frames, start, threads)


def board_series(
    board: RevolvedBody,
    poses: list[tuple[FloatArray, FloatArray]],
    camera: Camera,
    shape: tuple[int, int],
    *,
    lens: Lens | None = None,
    background: float = 0.04,
    device: str = "cpu",
    threads: int = 1,
) -> Iterator[Light]:
    """Light on the pixels of one camera that looks at a flat board, one pose per frame; see `picture_series`.

    ``board``: only its texture is used. x of the board's frame is around, y is along. ``poses``: R and t
    of each frame, from the board's frame to the rig's, `X = R x + t`.
    """
    lens = lens or Lens()
    start = select_device(device)
    posed = replace(board, turn=np.stack([R.T for R, _ in poses]), place=np.stack([t for _, t in poses]))
    bodies = upload_bodies((posed,), len(poses), camera, start)
    reach = float(np.hypot(*board.texture.grey.shape)) * board.texture.pitch
    depths = [float(camera.in_camera(t[None])[0, 2]) for _, t in poses]
    weights, pad = _weights(camera, lens, (max(min(depths) - reach, 1e-3), max(depths) + reach))
    view = upload_view(camera, shape, pad, lens, Lamp(), background, None, 1.0, start)
    yield from frames(rays_of_board(view, bodies, start), view, weights, shape, len(poses), start, threads)


def _weights(
    camera: Camera, lens: Lens, depths: tuple[float, float]
) -> tuple[tuple[NDArray[np.float32], float, float], int]:
    """Weights of the lens at all distances of a scene, first spread and step [px], and their reach [px]."""
    widest = float(max(np.max(lens.total(camera.fx, np.array(depths))), lens.spread))
    if widest > WIDEST:
        raise ValueError(
            f"the lens smears a point over {widest:.1f} px: allowed is up to {WIDEST:g} px; take a smaller "
            "aperture or bring its focus nearer to the scene"
        )
    table, step, reach = weight_table(lens.spread, widest, lens.rays)
    return (table, lens.spread, step), reach


def _depths(scene: Scene, camera: Camera) -> tuple[float, float]:
    """Smallest and largest distance of the bodies' nodes along the optical axis [m]."""
    depths = []
    for body in scene.bodies:
        widest = float(body.r.max())
        corners = [
            (x, y, z)
            for x in (-widest, widest)
            for y in (body.y.min(), body.y.max())
            for z in (-widest, widest)
        ]
        for place in (body.place.min(axis=0), body.place.max(axis=0)):
            X = np.array(corners) @ body.turn.reshape(-1, 3, 3)[0] + place
            depths += camera.in_camera(X)[:, 2].tolist()
    return max(min(depths), 1e-3), max(*depths, 1e-3)


@dataclass(frozen=True)
class Sensor:
    """A camera's sensor. Raises ValueError if a value is outside its range."""

    bits: int = 12
    """Bits of a grey value."""
    full_well: float = 15_000.0
    """Electrons of the largest grey value."""
    read_noise: float = 30.0
    """Standard deviation without light [electrons]."""
    black: float = 0.02
    """Grey value without light over the largest one [-]."""
    white: float = 0.7
    """Grey value of light 1 over the largest one [-]."""
    fixed_pattern: float = 0.0
    """Standard deviation of the pixels' gains [-]."""
    flicker: float = 0.0
    """Standard deviation of the light's brightness from frame to frame [-]."""
    gradient: float = 0.0
    """Light at the right edge of the picture over that at the left edge, minus 1; linear between [-]."""

    def __post_init__(self) -> None:
        if not 1 <= self.bits <= 16:
            raise ValueError(f"bits must be 1 to 16, got {self.bits}")
        if not 0.0 <= self.black < self.white <= 1.0:
            raise ValueError(f"0 <= black < white <= 1 is needed, got {self.black}, {self.white}")
        for name in ("read_noise", "fixed_pattern", "flicker"):
            if not 0.0 <= getattr(self, name) < np.inf:
                raise ValueError(f"{name} must be finite and not negative, got {getattr(self, name)}")
        if not 0.0 < self.full_well < np.inf or not -1.0 < self.gradient < 10.0:
            raise ValueError(
                f"full_well must be > 0 and gradient > -1, got {self.full_well}, {self.gradient}"
            )

    @property
    def largest(self) -> int:
        """Largest grey value."""
        return int(2**self.bits - 1)

    @property
    def per_electron(self) -> float:
        """Grey values per electron."""
        return self.largest / self.full_well

    def electrons(self, light: NDArray[np.floating]) -> FloatArray:
        """Mean electrons of light on a pixel."""
        return np.asarray(light, dtype=np.float64) * (self.white - self.black) * self.full_well

    def pattern(self, shape: tuple[int, int], rng: np.random.Generator) -> FloatArray:
        """Gains of the pixels with the lamp's gradient, mean 1, shape [rows, columns]."""
        across = 1.0 + self.gradient * (np.linspace(0.0, 1.0, shape[1]) if shape[1] > 1 else np.zeros(1))
        gains = 1.0 + self.fixed_pattern * rng.standard_normal(shape)
        return np.asarray(gains * across / across.mean())

    def expose(
        self, light: NDArray[np.floating], pattern: FloatArray, brightness: float, rng: np.random.Generator
    ) -> NDArray[np.uint16]:
        """Grey values of one picture, shape [rows, columns].

        Photons have a Poisson distribution, read noise is Gaussian. The sum is rounded and clipped at 0 and
        the largest grey value.

        ``light``: light on the pixels, 1 for white paint, shape [rows, columns]. ``pattern``: result of
        `pattern` for this camera. ``brightness``: brightness of the lamp in this frame, 1 on average.
        """
        mean = np.maximum(self.electrons(light) * pattern * brightness, 0.0)
        caught = rng.poisson(mean) + self.read_noise * rng.standard_normal(mean.shape)
        grey = self.black * self.largest + caught * self.per_electron
        return np.clip(np.rint(grey), 0, self.largest).astype(np.uint16)


Stack = NDArray[np.uint16]
"""Grey values, shape [n_frames, rows, columns]."""

_SETUP = 0x1AF8
"""Length of SETUP in a cine of version 1 [bytes]."""


def _write_tiff(path: Path, pictures: Stack, *, bits: int, times: NDArray[np.float64], rate: float) -> None:
    """Write a stack of 16-bit pages."""
    with replacing(path) as partial:
        tifffile.imwrite(partial, pictures, photometric="minisblack")


def _write_png(path: Path, pictures: Stack, *, bits: int, times: NDArray[np.float64], rate: float) -> None:
    """Write a folder with a numbered series of 8-bit files; lower bits are dropped."""
    path.mkdir()
    shift = max(bits - 8, 0)
    for number, picture in enumerate(pictures):
        if not cv2.imwrite(str(path / f"{number:04d}.png"), (picture >> shift).astype(np.uint8)):
            raise OSError(f"{path}: picture {number} cannot be written")


def write_numbered(path: Path, picture: NDArray[np.uint16], *, bits: int) -> None:
    """Write one PNG file of 8 bits, or of 16 bits if the grey values need more than 8."""
    if not cv2.imwrite(str(path), picture.astype(np.uint8) if bits <= 8 else picture):
        raise OSError(f"{path} cannot be written")


def _write_cine(path: Path, pictures: Stack, *, bits: int, times: NDArray[np.float64], rate: float) -> None:
    """Write a Phantom cine of 16-bit values. Its time stamps begin at the trigger, t = 0."""
    n, rows, columns = pictures.shape
    trigger = 1 << 31  # half a second: the fraction is not negative before the trigger
    setup = bytearray(_SETUP)
    struct.pack_into("<H", setup, 0, min(round(rate), 65535))  # FrameRate16
    struct.pack_into("<2sH", setup, 140, b"ST", _SETUP)
    struct.pack_into("<HH", setup, 737, columns, rows)  # ImWidth, ImHeight
    struct.pack_into("<I", setup, 768, round(rate))  # FrameRate
    struct.pack_into("<I", setup, 896, bits)  # RealBPP
    struct.pack_into("<II", setup, 5732, 0, 2**bits - 1)  # BlackLevel, WhiteLevel
    ticks = np.rint(times * 2.0**32).astype(np.int64) + trigger
    stamps = np.stack([(ticks & 0xFFFFFFFF) & ~np.int64(3), ticks >> 32], axis=1).astype("<u4")
    block = struct.pack("<IHH", 8 + stamps.nbytes, 1002, 0) + stamps.tobytes()
    at_setup = 44 + 40
    table = at_setup + len(setup) + len(block)
    size = rows * columns * 2
    first = table + 8 * n
    places = first + np.arange(n) * (8 + size)
    number = int(np.rint(times[0] * rate))
    header = struct.pack(
        "<2sHHHiIiIIIIII", b"CI", 44, 0, 1, number, n, number, n, 44, at_setup, table, trigger, 0
    )
    bitmap = struct.pack("<IiiHHIIiiII", 40, columns, rows, 1, 16, 0, size, 10_000, 10_000, 0, 2**bits)
    note = struct.pack("<II", 8, size)
    with replacing(path) as partial, partial.open("wb") as file:
        for part in (header, bitmap, bytes(setup), block, places.astype("<i8").tobytes()):
            file.write(part)
        for picture in pictures:
            file.write(note)
            file.write(picture[::-1].astype("<u2").tobytes())


def _write_mraw(path: Path, pictures: Stack, *, bits: int, times: NDArray[np.float64], rate: float) -> None:
    """Write a Photron recording of 16-bit values: `path` (.mraw) and the .cihx file in the same folder."""
    n, rows, columns = pictures.shape
    start = int(np.rint(times[0] * rate))
    text = (
        '<?xml version="1.0" encoding="utf-8"?>\n<cih><fileInfo><date>2026/01/01</date></fileInfo>'
        "<basicInfo><comment>made</comment></basicInfo><deviceInfo><deviceName>virtual</deviceName></deviceInfo>"
        f"<recordInfo><recordRate>{rate:.10g}</recordRate><shutterSpeed>{rate:.10g}</shutterSpeed></recordInfo>"
        f"<frameInfo><recordedFrame>{n}</recordedFrame><totalFrame>{n}</totalFrame><startFrame>{start}</startFrame>"
        "<skipFrame>1</skipFrame></frameInfo><imageFileInfo><fileFormat>MRaw</fileFormat></imageFileInfo>"
        f"<imageDataInfo><resolution><width>{columns}</width><height>{rows}</height></resolution>"
        "<colorInfo><type>Mono</type><bit>16</bit></colorInfo>"
        f"<effectiveBit><depth>{bits}</depth><side>Lower</side></effectiveBit></imageDataInfo></cih>\n"
    )
    with replacing(path.with_suffix(".cihx")) as partial:
        partial.write_text(text, encoding="utf-8")
    with replacing(path) as partial, partial.open("wb") as file:
        for picture in pictures:
            file.write(picture.astype("<u2").tobytes())


Writer = Callable[..., None]
WRITERS: dict[str, tuple[str, Writer]] = {
    "tiff": (".tif", _write_tiff),
    "png": ("", _write_png),
    "cine": (".cine", _write_cine),
    "mraw": (".mraw", _write_mraw),
}
"""By name of a format: the suffix of its file ("" for a folder) and its writer."""
