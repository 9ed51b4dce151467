"""Errors that a person can act on."""

from __future__ import annotations


class UserError(Exception):
    """A mistake in what the user gave; its text is the one line that the user sees.

    The line names file, place and value, and says what is allowed. Commands and nodes print it
    to standard error and end with exit status 2.
    """
