"""Tests; what several of them use is imported from here by its full name, such as `tests.recordings`."""
