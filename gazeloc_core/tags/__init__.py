"""AprilTags: found in pictures, measured on the scan, drawn and printed."""
