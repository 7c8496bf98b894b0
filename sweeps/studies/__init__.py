"""What is run: the constants of each sweep and study."""
