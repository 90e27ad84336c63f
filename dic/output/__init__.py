"""Surfaces as CSV files by VIC-3D's names, and the reporting table."""
