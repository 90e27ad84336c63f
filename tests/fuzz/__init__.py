"""Damaged and hostile inputs: damage of a file, its reader, the judged answer (`python -m tests.fuzz`)."""
