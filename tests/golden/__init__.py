"""Results of the program's commands, kept before a change of its structure and compared after it.

`python -m tests.golden make STORE` runs the cases of `tests.golden.cases` and keeps what they wrote;
`python -m tests.golden compare STORE` runs them again and says which numbers are others.
"""
