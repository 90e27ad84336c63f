"""Points followed through the frames of one camera."""

from dic.tracking.follow import track
from dic.tracking.settings import Tracking
from dic.tracking.history import Track

__all__ = ["Track", "Tracking", "track"]
