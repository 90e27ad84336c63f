"""Planning a test: expected uncertainties, best times and places of measurement, impact speed."""
