"""Structure from motion on the keyframes, and COLMAP's files."""
