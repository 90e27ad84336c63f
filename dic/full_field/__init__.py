"""Full-field measurement of any surface: a plane by one camera, a curved surface or a cylinder by two."""
