"""Facts of pictures, settings and speckles for the reporting table, as JSON can hold them."""

from typing import Any

from dic.chain.inspect_images import Inputs
from dic.chain.speckle_report import facts as speckle_facts
from dic.chain.speckle_report import speckles
from dic.images import PictureError
from dic.result import Body


def facts_of(inputs: Inputs) -> dict[str, Any]:
    """Pictures and settings."""
    pictures, settings = inputs.pictures, inputs.settings
    correlation = settings.tracking.correlation
    return {
        "pictures": {
            "shape": list(pictures[0].shape),
            "bits": pictures[0].bits,
            "crop_offset": [list(series.crop_offset) for series in pictures],
            "noise_grey": [grey.sigma for grey in inputs.grey],
        },
        "settings": {
            "subset": correlation.subset,
            "step": settings.step,
            "strain_window": settings.strain_window,
            "prefilter": correlation.prefilter,
            "shape": correlation.shape.name.lower(),
            "stereo_shape": settings.stereo.shape.name.lower(),
            "criterion": "ZNSSD, inverse-compositional Gauss-Newton",
            "interpolant": "quintic B-spline",
            "reference": "a point's own earlier picture, renewed where its correlation or stretch asks "
            "for it",
            "strip_half_width_m": settings.strip_half_width,
            "toward_flyer": settings.toward_flyer,
            "zero_px": list(settings.zero),
        },
    }


def speckles_of(inputs: Inputs, specimen: Body, rest: list[int]) -> list[dict[str, Any]]:
    """The speckle report of both cameras; where there can be none, why."""
    found: list[dict[str, Any]] = []
    for series, noise, pixels in zip(inputs.pictures, inputs.grey, specimen.pixels, strict=True):
        try:
            judged = speckles(series, rest, noise, pixels[rest[0]], subset=inputs.settings.subset)
        except (PictureError, ValueError) as error:
            found.append({"problem": str(error)})
        else:
            found.append(speckle_facts(judged.quality))
    return found
