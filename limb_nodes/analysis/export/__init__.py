"""A bag as a table for other programs: what is in it, power and work, and the files that hold it."""
