"""Bar signals: from volts to waves, forces, strain and stress, each with its uncertainty and its corrections."""
