"""What every room uses: measured histories, units, errors, files; no physics."""
