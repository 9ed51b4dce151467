"""Muscle-driven limbs as ROS 2 nodes: from a recording of EMG to a movement."""

__version__ = "0.1.0"
