"""Pictures to surfaces."""
