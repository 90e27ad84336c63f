"""Damaged, hostile and odd inputs: what damages a file, what reads it, and how the answer is judged.

`python -m tests.fuzz` runs the fixed corpus, `python -m tests.fuzz --seconds 600` cases at
random for so long.
"""
