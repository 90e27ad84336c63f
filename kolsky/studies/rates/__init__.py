"""Several identified shots: their mean stiffness, the scatter between them, and how it goes with the rate."""
