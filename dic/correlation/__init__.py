"""Subset matching by inverse-compositional Gauss-Newton, for many points at once.

`subsets` defines the inputs and the result of a match; `kernels` contains the search on a CPU or a GPU.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dic.basics import FloatArray
from dic.correlation.kernels.launch import Batch, load_kernels, search
from dic.correlation.subsets import Correlation, Match, Noise, PictureStack, Shape, Templates
from dic.processes import cores


def correlate(
    reference: PictureStack,
    deformed: PictureStack,
    points: ArrayLike,
    guess: ArrayLike,
    settings: Correlation,
    *,
    reference_picture: ArrayLike = 0,
    deformed_picture: ArrayLike = 0,
    reference_warp: ArrayLike | None = None,
    mask: ArrayLike | None = None,
    templates: Templates | None = None,
    template_rows: ArrayLike | None = None,
    threads: int | None = None,
) -> Match:
    """Match subsets of one picture in another.

    The template of a point is ``T(ξ) = f(W_ref(ξ))``; f is one of the pictures of `reference`. The result is
    the warp ``W`` that minimises the ZNSSD between T and ``g(W(ξ))``; g is one of the pictures of `deformed`.
    Both warps are total warps from the material picture.

    Parameters
    ----------
    reference, deformed
        Prepared pictures, on the same device and with the prefilter of `settings`.
    points
        Positions in the material picture (x, y) [px], shape [n, 2].
    guess
        Initial total warps, shape [n, 12]; a row with a NaN ends as NO_FIRST_GUESS.
    settings
        Subset, shape function and limits. A shape function of lower order does not fit the higher-order terms
        of the guess; only the composition of warps changes them.
    reference_picture, deformed_picture
        Index of the picture in its stack for each point, shape [n], or one index for all.
    reference_warp
        Total warps to the reference pictures, shape [n, 12]; None: the reference is the material picture
        itself.
    mask
        Pixels of the material picture that belong to the specimen, shape [rows, columns]; None: all.
    templates
        Storage that keeps the templates between calls; not used on a GPU.
    template_rows
        Row of each point in `templates`, shape [n]; None: in the order of the points.
    threads
        Number of CPU threads; None: all cores that the process may use. The result does not depend on it.

    Returns
    -------
    Match
        The match, one row per point.

    Raises
    ------
    ValueError
        If shapes do not match, or an index is outside the stacks. If the stacks are on two devices, or their
        prefilter is not that of `settings`. If the templates are for other settings or have too few rows.
    """
    points = np.ascontiguousarray(points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 2:
        raise ValueError(f"points must have shape [n, 2], got {points.shape}")
    n = len(points)
    if not np.isfinite(points).all():
        raise ValueError("points must be finite")
    guess = _warps("guess", guess, n)
    if reference.device != deformed.device:
        raise ValueError(f"both stacks must be on one device, got {reference.device} and {deformed.device}")
    for name, stack in (("reference", reference), ("deformed", deformed)):
        if stack.prefilter != settings.prefilter:
            raise ValueError(
                f"the {name} pictures were prepared with prefilter {stack.prefilter} px, the settings "
                f"state {settings.prefilter} px: prepare them again, or change the settings"
            )
    batch = Batch(
        points=points,
        guess=guess,
        reference=None if reference_warp is None else _warps("reference_warp", reference_warp, n),
        reference_picture=_pictures("reference_picture", reference_picture, n, reference.n_pictures),
        deformed_picture=_pictures("deformed_picture", deformed_picture, n, deformed.n_pictures),
        mask=None if mask is None else _mask(mask),
        templates=templates,
        place=_places(templates, template_rows, n, settings),
    )
    return search(reference, deformed, batch, settings, threads or cores())


def _warps(name: str, warps: ArrayLike, n: int) -> FloatArray:
    warps = np.ascontiguousarray(warps, dtype=np.float64)
    if warps.shape != (n, 12):
        raise ValueError(f"{name} must have shape {(n, 12)}, a warp a point, got {warps.shape}")
    return warps


def _pictures(name: str, index: ArrayLike, n: int, available: int) -> NDArray[np.int32]:
    if isinstance(index, int) and 0 <= index < available:
        return np.full(n, index, dtype=np.int32)
    indices = np.asarray(index)
    if indices.dtype.kind not in "iu" or indices.shape not in ((), (n,)):
        raise ValueError(f"{name} must be a whole number or {n} of them, got {indices.dtype} {indices.shape}")
    if n and not (indices.min() >= 0 and indices.max() < available):
        raise ValueError(f"{name} must be from 0 to {available - 1}, got {indices.min()} to {indices.max()}")
    return np.array(np.broadcast_to(indices, n), dtype=np.int32)


def _places(
    templates: Templates | None, rows: ArrayLike | None, n: int, settings: Correlation
) -> NDArray[np.int64]:
    places = np.arange(n) if rows is None else np.asarray(rows, dtype=np.int64)
    if templates is None:
        return places
    if templates.settings != settings:
        raise ValueError(f"templates are for {templates.settings}, not for {settings}")
    room = len(templates.known)
    if places.shape != (n,) or (n and not (places.min() >= 0 and places.max() < room)):
        raise ValueError(f"template_rows must be {n} whole numbers from 0 to {room - 1}")
    return places


def _mask(mask: ArrayLike) -> NDArray[np.uint8]:
    values = np.asarray(mask)
    if values.dtype != np.bool_ or values.ndim != 2:
        raise ValueError(
            f"mask must be true or false with shape [rows, columns], got {values.dtype} {values.shape}"
        )
    return np.ascontiguousarray(values).view(np.uint8)


__all__ = ["Correlation", "Match", "Noise", "PictureStack", "Shape", "Templates", "correlate", "load_kernels"]
