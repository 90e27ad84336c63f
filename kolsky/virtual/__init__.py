"""Synthetic tests: complete shot folders from a chosen truth. They have the faults of a real laboratory."""
