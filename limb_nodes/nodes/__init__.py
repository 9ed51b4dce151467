"""The ROS 2 nodes. They move messages; what they compute stands in `limb_nodes.solve`."""

import sys

from limb_nodes.edge import as_program

# Python is about to import a node as the program (`python -m limb_nodes.nodes.muscle_stack`), which may fail.
if sys.argv[0] == "-m":
    as_program()
