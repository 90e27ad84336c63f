"""What a stranger's folder holds, for `kolsky new`: tables, recordings and pictures, and a new shot file."""
