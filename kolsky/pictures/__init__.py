"""Pictures of a shot: opened, calibrated, correlated, kept in dic.h5; frames, regions drawn by hand."""
