"""Keypoints: picking, what pairs are worth, the live alignment, suggestions."""
