"""Signals: what drives a limb or is measured on it, from files, bags and formulas to arrays; raw EMG to envelopes.

`activation.load_activation`, `recording.read_recording`, `emg.envelopes`, `length_course.read_length_course`.
"""
