"""Replay memories: uniform, prioritised (23)(24) on a sum tree, and n-step returns (28)."""
