"""Keypoints that people click: from pictures to places on the scan, and their files."""
