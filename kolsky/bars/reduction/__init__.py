"""A test between bars: from the waves at the faces to stress, strain and rate."""
