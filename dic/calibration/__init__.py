"""Cameras and their poses from pictures of targets."""
