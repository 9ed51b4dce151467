"""The ROS 2 nodes. They move messages; what they compute stands in `limb_nodes.solve`."""
