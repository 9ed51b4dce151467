"""Faults on purpose: every kind is tried many times, and `python -m tests.faults` prints what became of it.

A kind is a module of this package with `KIND`, a few words, `COUNT`, how many trials make the full table, and
`trials(count, seed)`, which yields a `Trial` for each.
"""
