"""Results of the program's commands, stored before a change of its structure and compared after it.

`python -m tests.golden make STORE` runs the cases of `tests.golden.cases` and stores their output. `python -m
tests.golden compare STORE` runs them again and prints different numbers.
"""
