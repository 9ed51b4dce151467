"""What the nodes of a run exchange, and the part of each in it, without ROS."""
