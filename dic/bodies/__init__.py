"""Bodies in the pictures: their regions, tracking of their points by two cameras, the ends of the
specimen."""
