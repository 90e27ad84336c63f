"""Signals of gauges and transducers: from volts to strain and force, with noise and zero."""
