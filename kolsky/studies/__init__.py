"""Studies over many simulations or many shots: sweeps, sensitivities, rates, plans."""
