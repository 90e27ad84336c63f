"""Material laws fitted to homogeneous tests: residuals, searches, stability, comparison."""
