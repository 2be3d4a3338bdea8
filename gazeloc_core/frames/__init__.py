"""A recording's pictures: read, undistorted, marked by people."""
