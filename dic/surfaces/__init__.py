"""From points in space to the specimen: cylinder, test frame, outline, strains."""
