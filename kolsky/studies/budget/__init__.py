"""The error budget of a test: what each source of error does to the answer, by repeating the whole test."""
