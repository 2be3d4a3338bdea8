"""Ways to localise a recording's frames in the scan, a module each. None falls back to another."""
