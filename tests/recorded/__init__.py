"""Tests on recordings, and on one that is generated, all the way from raw EMG to a movement."""
