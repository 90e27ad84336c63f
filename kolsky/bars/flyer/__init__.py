"""The flyer: its path, smooth from rest; its flight in three dimensions; the events of its test."""
