# What a prefix needs besides the Python package: the nodes as `ros2 run` looks for them, launch files, and params/.
# Read by colcon's build (CMakeLists.txt beside this file) and by pip's (msgs/wheel.cmake).
# Each node is a module limb_nodes.nodes.<node> with a function main().
foreach(node activation_input muscle_stack limb_dynamics recorder)
  file(CONFIGURE OUTPUT "${CMAKE_CURRENT_BINARY_DIR}/${node}" CONTENT [==[
#!/bin/sh
# To the shell the next line starts the prefix's own Python, or else the one on the PATH; to Python it is a string.
'''exec' "$(command -v "${0%/*}/../../bin/python3" || echo python3)" "$0" "$@"
' '''
from limb_nodes.nodes.@node@ import main

main()
]==] @ONLY)
  install(PROGRAMS "${CMAKE_CURRENT_BINARY_DIR}/${node}" DESTINATION lib/limb_nodes)
endforeach()
install(DIRECTORY "${CMAKE_CURRENT_LIST_DIR}/../params" DESTINATION share/limb_nodes)
install(DIRECTORY "${CMAKE_CURRENT_LIST_DIR}/launch" DESTINATION share/limb_nodes)
