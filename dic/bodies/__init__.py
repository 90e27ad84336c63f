"""Bodies in the pictures: where they are, their points followed by two cameras, the ends of the specimen."""

from dic.bodies.follow import Followed, follow_body
from dic.bodies.found_regions import FoundRegions, find_regions
from dic.bodies.region import Region

__all__ = ["Followed", "FoundRegions", "Region", "find_regions", "follow_body"]
