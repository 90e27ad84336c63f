"""Bodies in the pictures: where they are, their points followed by two cameras, the ends of the specimen."""
