"""Errors against a truth, agreement of frame and render, the paper's protocol."""
