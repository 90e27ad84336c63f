"""Points followed through the frames of one camera."""

from dic.tracking.follow import track
from dic.tracking.history import Track
from dic.tracking.settings import Tracking

__all__ = ["Track", "Tracking", "track"]
