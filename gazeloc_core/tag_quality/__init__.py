"""How good tag poses are, and which tags a room needs (sections V and IX of the paper)."""
