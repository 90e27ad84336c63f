"""A sheet of pictures with one defect each: `python -m benchmarks.wrong_pictures --figure FILE.png`.

Every key of [cameras], [optics] and [speckle] that degrades a picture is applied separately, at a visible
size. The sheet shows the first frame of camera 0 and a late one. The command prints the difference of each
picture from the one without defects.
"""

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.made_pictures import surface
from kolsky.virtual.pictures import expose_series, rig_of, scene_of
from kolsky.virtual.schema import Specification
from kolsky.virtual.truth import SurfaceHistory

FRAMES, SHOWN = 16, [0, 11, 15]
"""Number of frames of the motion, and indices of those that are rendered; the first and the last are
shown."""
WRONG: dict[str, dict[str, Any]] = {
    "nothing wrong": {},
    "motion blur": {"optics": {"exposure": "150 us"}},
    "lens not sharp": {"optics": {"spread": 2.0}},
    "out of focus": {"optics": {"aperture": "25 mm", "defocus": "8 mm"}},
    "few photons": {"optics": {"full_well": 500}},
    "read noise": {"optics": {"read_noise": 800}},
    "overexposed": {"optics": {"white": 1.0, "lamp_gradient": "60 %"}},
    "flicker": {"optics": {"flicker": "40 %"}},
    "fixed pattern": {"optics": {"fixed_pattern": "10 %"}},
    "lamp gradient": {"optics": {"lamp_gradient": "-70 %"}},
    "one lamp": {"optics": {"ambient": 0.1, "lamp_side": "50 deg"}},
    "highlight": {"optics": {"highlight": 0.6, "gloss": 200}},
    "heat haze": {"optics": {"haze": 1.5}},
    "scratch": {"speckle": {"scratch": "0.3 mm"}},
    "flake": {"speckle": {"flake": "0.8 mm"}},
    "loose paint": {"speckle": {"loose": "4 mm", "loose_slip": "0.5 mm"}},
    "printed": {"speckle": {"kind": "printed"}},
    "too coarse": {"speckle": {"size": 14}},
    "too fine": {"speckle": {"size": 1.5}},
    "too sparse": {"speckle": {"coverage": 0.08}},
    "flyer not painted": {"speckle": {"flyer": False}},
    "no flyer at rest": {"cameras": {"flyer_share": "-30 %"}},
    "much flyer": {"cameras": {"flyer_share": "40 %"}},
    "flyer from the left": {"cameras": {"flyer_side": "left"}},
    "flyer from below": {"cameras": {"flyer_side": "down"}},
    "cameras along": {"cameras": {"baseline": "along", "angle": "30 deg"}},
    "camera 0 nearer": {"cameras": {"distance_0": "150 mm", "distance_1": "400 mm"}},
    "distortion": {"cameras": {"distortion_0": [-30.0, 0.0, 0.0, 0.0, 0.0]}},
    "64 px": {"cameras": {"picture": [64, 64]}},
    "off centre": {"cameras": {"aside": "3 mm"}},
    "flyer pitches": {"imperfections": {"tilt": "8 deg"}},
}
"""Tables of the specification by name of the defect."""


def pictures(tables: dict[str, Any], *, device: str = "cpu", threads: int = 1) -> NDArray[np.floating]:
    """Frames of camera 0 over the largest grey value, shape [n_frames, rows, columns]."""
    cameras, optics = {"write": True, "picture": [96, 96]}, {"rays": 2}
    merged = {
        **tables,
        "cameras": {**cameras, **tables.get("cameras", {})},
        "optics": {**optics, **tables.get("optics", {})},
    }
    q = Specification.model_validate(merged)
    whole = surface(FRAMES, q)
    parts = (getattr(whole, name)[SHOWN] for name in ("time", "r", "y", "displacement", "tilt"))
    shown = SurfaceHistory(*parts)
    if q.imperfections.tilt:
        d = shown.displacement
        shown.tilt[:] = q.imperfections.tilt * d / d.max()
    rig = rig_of(q, shot=0)
    scene = scene_of(q, shown, shot=0)
    found = np.stack(list(expose_series(q, scene, rig.camera(0), 0, 0, device, threads)))
    return found / (2.0**q.optics.bits - 1.0)


def main() -> None:
    """Draw the sheet; print the differences."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--figure", type=Path, required=True)
    parser.add_argument("--device", default="cpu")
    given = parser.parse_args()
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    made = {name: pictures(tables, device=given.device) for name, tables in WRONG.items()}
    across = 8
    down = -(-len(made) // across)
    fig, axes = plt.subplots(2 * down, across, figsize=(7.1, 2.05 * down), layout="constrained")
    for ax in axes.ravel():
        ax.axis("off")
    for number, (name, frames) in enumerate(made.items()):
        row, column = divmod(number, across)
        for half, frame in enumerate((0, -1)):
            ax = axes[2 * row + half, column]
            ax.imshow(frames[frame], cmap="gray", vmin=0.0, vmax=1.0, interpolation="nearest")
            if half == 0:
                ax.set_title(name, fontsize=5, pad=2)
    fig.savefig(given.figure, dpi=160)
    right = made["nothing wrong"]
    apart = {
        name: round(float(np.abs(frames - right).mean()), 4) if frames.shape == right.shape else None
        for name, frames in made.items()
    }
    print(json.dumps(apart, indent=1))


if __name__ == "__main__":
    main()
