"""A local page on which every number of an environment can be changed, with what follows from it."""
