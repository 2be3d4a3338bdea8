"""Reconstructions that broke or warped: pieces placed by their own tags, the whole bent to the tags."""
