"""The paper's tables and figures, and the experiments that it left for later: functions from scenes to findings.

`python -m gazeloc_core.experiments` (or `make experiments`) runs them; what is there and fresh is not run again.
"""
