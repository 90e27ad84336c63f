"""The flyer: its smooth path from rest, its flight in three dimensions, and the events of its test."""
