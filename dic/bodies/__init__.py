"""Bodies in the pictures: where they are, their points followed by two cameras, the ends of the specimen."""

from dic.bodies.follow import TrackedBody, follow_body
from dic.bodies.region import FoundRegions, Region, find_regions

__all__ = ["FoundRegions", "Region", "TrackedBody", "find_regions", "follow_body"]
