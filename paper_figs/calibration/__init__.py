"""How often intervals and verdicts are right: every rule, in worlds at the edge of a claim, by simulation.

`python -m paper_figs.calibration` writes the table and the figure.
"""
