"""The error budget of a test.

The whole test is repeated to find the effect of each error source on the answer.
"""
