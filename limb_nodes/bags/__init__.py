"""Bags: rosbag2 folders (MCAP) that hold a run, written, read and recovered without ROS.

`write.BagWriter`, `read.BagReader`, `recover.recover`; `types` makes messages without ROS.
"""
