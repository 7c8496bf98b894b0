"""The claims of the paper, and how each is judged."""
