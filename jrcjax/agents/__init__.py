"""Trained agents away from their training, and their files."""
