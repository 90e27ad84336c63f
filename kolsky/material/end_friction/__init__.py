"""End friction in quasi-static compression, and the material curve without it."""
