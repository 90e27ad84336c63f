"""Survey of a user's folder for `kolsky new`: tables, recordings, pictures, and the new shot file."""
