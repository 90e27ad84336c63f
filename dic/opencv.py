"""OpenCV, loaded when it is first used: `from dic.opencv import cv2`.

It is 160 MB that only pictures need, so it is the extra `pictures` of the package. Results of pictures are
read, compared and shown without it.
"""

from typing import TYPE_CHECKING, Any


class OpenCVMissing(ModuleNotFoundError):
    """OpenCV is not installed."""


class _OpenCV:
    """Stand-in for the module: the first name that is asked for imports it."""

    def __getattr__(self, name: str) -> Any:
        try:
            import cv2 as module
        except ImportError as error:
            raise OpenCVMissing(
                "pictures need OpenCV: pip install 'kolsky[pictures]'", name=error.name
            ) from None
        return getattr(module, name)


if TYPE_CHECKING:
    import cv2 as cv2
else:
    cv2 = _OpenCV()
