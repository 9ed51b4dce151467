"""What is examined, fitted and drawn: no ROS, on top of the whole-model solve."""
