"""Comparison of synthetic and real pictures: `python -m benchmarks.picture_look SHOT OTHER --figure
FILE.png`.

The command evaluates the pictures at rest of both cameras of each shot. It prints grey values, speckles,
noise, and the spectra of pattern and noise. The measures are those of the package's picture checks
(`dic.images`). The figure shows pairs of both shots at rest and late in the test on one grey scale, with
histograms and spectra.
"""

import argparse
import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dic.images import grey_noise, open_pictures, speckle_quality

STATIC = 10
"""Number of frames at rest that are used."""
OCTAVES = ((0.0, 1 / 16), (1 / 16, 1 / 8), (1 / 8, 1 / 4), (1 / 4, 1 / 2))
"""Bands of the spectrum [cycles/px]."""
PERCENTILES = (1, 10, 50, 90, 99)
SUBSET = 21
LATE = 0.75
"""Late frame of the figure, as a share of the number of frames [-]."""

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Look:
    """Measures of one camera's pictures."""

    first: Floats
    """Mean of the frames at rest over the largest grey value, shape [rows, columns]."""
    late: Floats
    """A late frame over the largest grey value, shape [rows, columns]."""
    region: tuple[slice, slice]
    """Rows and columns of the evaluated region of the specimen."""
    frequency: Floats
    """Central frequencies of the rings of the spectra [cycles/px], shape [n]."""
    pattern: Floats
    """Spectrum of the pattern after subtraction of the noise, over its sum, shape [n]."""
    noise: Floats
    """Spectrum of the noise over its mean, shape [n]; 1 everywhere for white noise."""
    numbers: dict[str, Any]
    """Measures by name."""


def radial(square: Floats) -> tuple[Floats, Floats]:
    """Mean of a two-dimensional power spectrum over rings, and their frequencies [cycles/px]."""
    f = np.hypot(*np.meshgrid(*(np.fft.fftfreq(n) for n in square.shape), indexing="ij"))
    edges = np.linspace(0.0, 0.5, 33)
    ring = np.digitize(f.ravel(), edges) - 1
    use = (ring >= 0) & (ring < 32)
    sums = np.bincount(ring[use], square.ravel()[use], minlength=32)
    return 0.5 * (edges[1:] + edges[:-1]), sums / np.bincount(ring[use], minlength=32)


def power(picture: Floats) -> Floats:
    """Power spectrum of a picture without its mean, under a Hann window."""
    window = np.outer(*(np.hanning(n) for n in picture.shape))
    even = (picture - np.average(picture, weights=window)) * window
    return np.abs(np.fft.fft2(even)) ** 2 / (window**2).sum()


def look(path: Path, share: float, bits: int) -> Look:
    """Evaluate a picture series; the central `share` of the picture is assumed to show the specimen."""
    pictures = open_pictures(path, bits=bits)
    top = 2.0**pictures.bits - 1.0
    frames = np.stack([pictures.frame(k) for k in range(STATIC)]).astype(np.float64)
    rows, columns = pictures.shape
    edge = [int(0.5 * (1.0 - share) * n) for n in (rows, columns)]
    region = slice(edge[0], rows - edge[0]), slice(edge[1], columns - edge[1])
    mask = np.zeros(pictures.shape, dtype=bool)
    mask[region] = True
    noise = grey_noise(list(frames), range(STATIC), mask=mask)
    mean = frames.mean(axis=0)
    quality = speckle_quality(mean, mask, SUBSET, noise, averaged=STATIC)
    cut = mean[region]
    own = np.mean([power(a[region] / a[region].mean() - cut / cut.mean()) for a in frames], axis=0)
    own *= cut.mean() ** 2 * STATIC / (STATIC - 1)
    frequency, noisy = radial(own)
    _, seen = radial(power(cut))
    pattern = np.maximum(seen - noisy / STATIC, 0.0) * frequency  # length of a ring
    bands = [float(pattern[(frequency >= a) & (frequency < b)].sum() / pattern.sum()) for a, b in OCTAVES]
    grey = np.percentile(cut / top, PERCENTILES)
    numbers = {
        "bits": pictures.bits,
        **{f"grey, {p} %": round(float(g), 4) for p, g in zip(PERCENTILES, grey, strict=True)},
        "dark share": round(quality.coverage, 3),
        "speckle by correlation, x (px)": round(quality.size[0], 2),
        "speckle by correlation, y (px)": round(quality.size[1], 2),
        "speckle by edges (px)": round(quality.size_by_edges, 2),
        "mean gradient over contrast (1/px)": round(quality.mean_gradient / float(cut.std()), 4),
        "noise (share of full scale)": round(noise.sigma / top, 5),
        "noise variance at black (share^2 1e6)": round(noise.intercept / top**2 * 1e6, 3),
        "noise variance per grey (share 1e6)": round(noise.slope / top * 1e6, 3),
        "noise of the upper half of frequencies over the lower": round(
            float(noisy[frequency > 0.25].mean() / noisy[frequency <= 0.25].mean()), 3
        ),
        "flicker": round(float(noise.gain.std()), 5),
        f"floor of {SUBSET} px (mpx)": round(1e3 * quality.median_floor, 2),
        **{f"pattern in {a:g} to {b:g} 1/px": round(x, 3) for (a, b), x in zip(OCTAVES, bands, strict=True)},
    }
    late = pictures.frame(int(LATE * pictures.n_frames)) / top
    return Look(mean / top, late, region, frequency, pattern / pattern.sum(), noisy / noisy.mean(), numbers)


def draw(path: Path, looks: dict[str, list[Look]]) -> None:
    """Draw pairs of pictures on one grey scale, histograms and spectra."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    top = max(float(np.percentile(one.first, 99.9)) for pair in looks.values() for one in pair)
    fig, axes = plt.subplots(len(looks) + 1, 4, figsize=(7.1, 1.9 * (len(looks) + 1)), layout="constrained")
    for row, (name, pair) in zip(axes, looks.items(), strict=False):
        for ax, picture, words in zip(
            row,
            [pair[0].first, pair[1].first, pair[0].late, pair[1].late],
            ["camera 0, at rest", "camera 1, at rest", "camera 0, late", "camera 1, late"],
            strict=True,
        ):
            ax.imshow(picture, cmap="gray", vmin=0.0, vmax=top, interpolation="nearest")
            ax.set_title(f"{name}: {words}", fontsize=6)
            ax.set_xticks([])
            ax.set_yticks([])
    for ax in axes[-1][2:]:
        ax.remove()
    histogram, spectrum = axes[-1][:2]
    for name, pair in looks.items():
        one = pair[0]
        counts, edges = np.histogram(one.first[one.region], bins=60, range=(0.0, top), density=True)
        histogram.step(edges[:-1], counts, where="post", lw=0.8, label=name)
        spectrum.semilogy(one.frequency, one.pattern, lw=0.8, label=name)
    histogram.set_xlabel("grey value over the largest (–)", fontsize=7)
    histogram.set_ylabel("density (–)", fontsize=7)
    spectrum.set_xlabel("frequency (cycles/px)", fontsize=7)
    spectrum.set_ylabel("share of the pattern (–)", fontsize=7)
    spectrum.set_ylim(1e-6, 1.0)
    for ax in (histogram, spectrum):
        ax.tick_params(labelsize=6)
    histogram.legend(fontsize=6, frameon=False)
    fig.savefig(path, dpi=160)


def main() -> int:
    """Print the measures of all pictures in one table, or as JSON."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("shots", nargs="+", type=Path, help="folders with cam0.tif and cam1.tif")
    parser.add_argument("--names", default="", help="names for the table, separated by commas")
    parser.add_argument("--share", type=float, default=0.7, help="share of a picture taken for the specimen")
    parser.add_argument("--bits", type=int, default=12, help="bits that carry the grey value")
    parser.add_argument("--figure", type=Path)
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    names = given.names.split(",") if given.names else [str(shot) for shot in given.shots]
    if len(names) != len(given.shots):
        parser.error(f"--names has {len(names)} names for {len(given.shots)} shots")
    looks = {
        name: [look(shot / f"cam{k}.tif", given.share, given.bits) for k in (0, 1)]
        for name, shot in zip(names, given.shots, strict=True)
    }
    if given.figure:
        draw(given.figure, looks)
    if given.json:
        print(json.dumps({name: [one.numbers for one in pair] for name, pair in looks.items()}, indent=1))
        return 0
    heads = [f"{name}, camera {k}" for name in looks for k in (0, 1)]
    print(f"| measure | {' | '.join(heads)} |\n| --- |{' --- |' * len(heads)}")
    columns = [one.numbers for pair in looks.values() for one in pair]
    for key in columns[0]:
        print(f"| {key} | {' | '.join(str(column[key]) for column in columns)} |")
    return 0


if __name__ == "__main__":
    sys.exit(main())
