"""Compiling and solving: the whole model at once, and the steps that the nodes take."""

from limb_nodes.solve.cache import guard_numba

guard_numba()
