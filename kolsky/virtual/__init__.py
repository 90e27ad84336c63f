"""The virtual laboratory: complete shot folders from a chosen truth, with the faults of a real laboratory."""
