"""Several identified shots: mean stiffness, scatter between the shots, and dependence on the strain rate."""
