"""Charts as values, their colours and their files."""
