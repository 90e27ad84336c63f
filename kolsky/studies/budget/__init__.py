"""The error budget of a test: effect of each error source on the answer, by repeating the whole test."""
