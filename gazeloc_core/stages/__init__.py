"""The stages of the method: each a function from a project to one artifact. pipeline.py lists and runs them."""
