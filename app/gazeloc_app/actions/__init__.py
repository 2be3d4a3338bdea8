"""Everything that can happen, as values, in files by what they are about; action.py says what an action is."""
