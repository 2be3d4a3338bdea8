"""`python -m gazeloc_app` is the command `gazeloc`."""

from gazeloc_app.cli import main

main()
