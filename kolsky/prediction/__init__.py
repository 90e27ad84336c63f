"""Prediction of a planned flyer test, beginning with the striker's impact."""
