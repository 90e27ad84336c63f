"""Planning a test: expected uncertainties, where and when to measure, impact speed."""
