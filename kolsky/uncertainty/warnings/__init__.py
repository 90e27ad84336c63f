"""Warnings before an answer is used: one sentence each, with the value and the cure."""
