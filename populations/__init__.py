"""Studies that test the program on many experiments with known answers; their results are in `results/`."""
