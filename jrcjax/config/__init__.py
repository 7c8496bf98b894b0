"""Environments and hyperparameters as text: TOML files, dotted names, the reference page."""
