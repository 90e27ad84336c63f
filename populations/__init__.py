"""Studies that judge the program by many experiments with known answers; their results are in `results/`."""
