"""Damaged, hostile and unusual inputs: the damage of a file, its reader, and the evaluation of the answer.

`python -m tests.fuzz` runs the fixed corpus. `python -m tests.fuzz --seconds 600` runs random cases for this
time.
"""
