"""How a sweep is run: one compiled program, block by block, here or on a cluster."""
