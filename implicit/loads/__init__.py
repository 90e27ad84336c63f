"""External forces: dead loads and weight, pressure that follows the surface, contact with a rigid plane."""
