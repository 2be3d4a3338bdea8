"""Writers of aligned poses and 3D gaze: one file per format."""
