# rpbi_programs([NODES NAME FUNCTION ...] [COMMANDS NAME FUNCTION ...] [CONSOLE NAME MODULE ...])
#
# Makes a package's programs in the devel and the install space: rosrun and roslaunch find them by their names. Each
# calls a function, given as `module:function`, by `run` (nodes) or `run_command` (commands) of
# custom_ros_tools.program, or the command of a module by `run_console` of custom_ros_tools.console.modules.
function(rpbi_programs)
  set(calls_NODES program run)
  set(calls_COMMANDS program run_command)
  set(calls_CONSOLE console.modules run_console)
  cmake_parse_arguments(PARSE_ARGV 0 table "" "" "NODES;COMMANDS;CONSOLE")
  foreach(kind NODES COMMANDS CONSOLE)
    list(GET calls_${kind} 0 module)
    list(GET calls_${kind} 1 call)
    while(table_${kind})
      list(POP_FRONT table_${kind} name target)
      set(program ${CMAKE_CURRENT_BINARY_DIR}/programs/${name})
      # The interpreter that has ROS: `env python3` would be the first Python on PATH.
      # Processes that a program starts may import it, and must not run it.
      file(WRITE ${program}
"#!/usr/bin/python3
# Made by CMake from CMakeLists.txt of ${PROJECT_NAME}.

from custom_ros_tools.${module} import ${call}

if __name__ == \"__main__\":
    ${call}(\"${target}\")
")
      file(
        COPY ${program} DESTINATION ${CATKIN_DEVEL_PREFIX}/${CATKIN_PACKAGE_BIN_DESTINATION}
        FILE_PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE
      )
      install(PROGRAMS ${program} DESTINATION ${CATKIN_PACKAGE_BIN_DESTINATION})
    endwhile()
  endforeach()
endfunction()
