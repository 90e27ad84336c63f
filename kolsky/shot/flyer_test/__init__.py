"""A flyer test reduced by classical means: forces, strain and stress from its own recordings."""
