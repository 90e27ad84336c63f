"""Goodness of fit by channel, clock errors, and the search for a wrong input."""
