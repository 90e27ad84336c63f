"""Bar signals: from volts to waves, forces, strain and stress, each with uncertainty and corrections."""
