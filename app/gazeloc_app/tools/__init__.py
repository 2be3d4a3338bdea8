"""What a click in the scene does, one tool a file; tool.py says what a tool is, all.py lists them in their order."""
