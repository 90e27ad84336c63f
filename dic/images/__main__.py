"""Report on a picture series and its quality: ``python -m dic.images PATH``."""

import argparse
import sys
from pathlib import Path

import numpy as np

from dic.images import PictureError, frame_health, grey_noise, open_pictures, speckle_quality
from dic.outcome import FrameOutcome


def main(arguments: list[str] | None = None) -> int:
    """Print the report; returns 1 if the pictures cannot be opened or assessed."""
    parser = argparse.ArgumentParser(prog="python -m dic.images", description=__doc__)
    parser.add_argument("path", type=Path, help="a picture file, or a folder with a numbered series")
    parser.add_argument("--pattern", help='names in a folder, "cam0_*.png", or a dataset of an HDF5 file')
    parser.add_argument(
        "--bits", type=int, help="bits that carry the grey value, if the file does not state it"
    )
    parser.add_argument("--static", type=int, default=0, help="number of frames at the start without motion")
    parser.add_argument("--subset", type=int, default=21, help="side of the subset [px]")
    parser.add_argument("--wanted", type=float, help="noise floor to be reached [px]")
    options = parser.parse_args(arguments)
    try:
        report(options)
    except (PictureError, ValueError) as error:
        print(error, file=sys.stderr)
        return 1
    return 0


def report(options: argparse.Namespace) -> None:
    """Print the header's values, the health of the frames, and the quality of the speckles."""
    pictures = open_pictures(options.path, pattern=options.pattern, bits=options.bits)
    rows, columns = pictures.shape
    clock = "no times" if pictures.times is None else f"{pictures.times[0]:.9g} to {pictures.times[-1]:.9g} s"
    print(
        f"{pictures.path}: {pictures.n_frames} frames of {columns} x {rows} px, {pictures.bits} bits, {clock}"
    )

    health = frame_health(pictures)
    good = np.flatnonzero(health.outcome == FrameOutcome.VALID)
    print(
        f"{good.size} good frames, {int(health.flashed.sum())} of them with a flash, ceiling {health.ceiling}"
    )
    for note in health.notes.values():
        print(f"  {note}")
    static = [int(index) for index in good if index < options.static]
    if len(static) < 2:
        print("noise and speckles: give --static N, at least 2 good frames without motion")
        return
    noise = grey_noise(pictures, static)
    motion = np.abs(noise.motion).max()
    print(
        f"noise {noise.sigma:.3g}: variance {noise.intercept:.4g} + {noise.slope:.3g} grey; "
        f"flicker {noise.gain.std():.2%}, rigid motion up to {motion * 1e3:.2g} mpx over {len(static)} frames"
    )
    mean = np.mean([pictures.frame(index) for index in static], axis=0)
    quality = speckle_quality(mean, None, options.subset, noise, averaged=len(static), wanted=options.wanted)
    print(
        f"speckles {quality.size[0]:.2f} x {quality.size[1]:.2f} px by correlation, "
        f"{quality.size_by_edges:.2f} px by edges; {quality.coverage:.0%} dark; "
        f"mean gradient {quality.mean_gradient:.4g} per px"
    )
    print(f"floor of a subset of {quality.subset} px: {quality.median_floor * 1e3:.2f} mpx (median)")
    if quality.needed is not None:
        judged = ~np.any(np.isnan(quality.floor), axis=2)
        print(
            f"{quality.too_small[judged].mean():.1%} of the points miss {options.wanted * 1e3:.4g} mpx; "
            f"subsets of up to {int(np.max(quality.needed))} px reach it at "
            f"{np.mean(quality.needed[judged] > 0):.1%}"
        )


if __name__ == "__main__":
    sys.exit(main())
