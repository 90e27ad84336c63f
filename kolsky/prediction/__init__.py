"""Prediction of a planned flyer test, from the striker's impact on."""
