"""GazeLoc's browser app and command line."""
