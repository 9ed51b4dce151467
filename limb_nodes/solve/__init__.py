"""Compiling and solving: the whole model at once, and the steps that the nodes take."""
