# Read only by the pip build (see pyproject.toml); colcon never sees it.
# pip's build environment is a prefix that has ROS in it but is not "sourced".
find_package(Python3 REQUIRED COMPONENTS Interpreter)
execute_process(
  COMMAND "${Python3_EXECUTABLE}" -c
    "import pathlib, ament_package as a; print(pathlib.Path(a.__file__).parents[4].as_posix())"
  OUTPUT_VARIABLE _ros_prefix OUTPUT_STRIP_TRAILING_WHITESPACE COMMAND_ERROR_IS_FATAL ANY)
message(STATUS "ROS prefix of the build environment: ${_ros_prefix}")
list(PREPEND CMAKE_PREFIX_PATH "${_ros_prefix}")
set(ENV{AMENT_PREFIX_PATH} "${_ros_prefix}")
# The wheels' imported targets name include folders of the machine they were built on.
function(_drop_missing_includes)
  get_property(targets DIRECTORY PROPERTY IMPORTED_TARGETS)
  foreach(target IN LISTS targets)
    get_target_property(dirs ${target} INTERFACE_INCLUDE_DIRECTORIES)
    if(dirs)
      list(FILTER dirs EXCLUDE REGEX "^/opt/python/")
      set_target_properties(${target} PROPERTIES INTERFACE_INCLUDE_DIRECTORIES "${dirs}")
    endif()
  endforeach()
endfunction()
cmake_language(DEFER CALL _drop_missing_includes)
# scikit-build sets SKBUILD for its own build only, not for the compiler checks that also read this file.
if(SKBUILD)
  file(WRITE "${CMAKE_CURRENT_BINARY_DIR}/marker" "")
  install(FILES "${CMAKE_CURRENT_BINARY_DIR}/marker"
    DESTINATION share/ament_index/resource_index/packages RENAME limb_nodes)
  install(FILES "${CMAKE_CURRENT_LIST_DIR}/../limb_nodes/package.xml" DESTINATION share/limb_nodes)
  include("${CMAKE_CURRENT_LIST_DIR}/../limb_nodes/install.cmake")
endif()
