# How this project's own code is compiled. C++17 exactly: pagmo needs it, generated ROS messages do
# not build with C++20.
set(CMAKE_CXX_STANDARD 17)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
set(CMAKE_POSITION_INDEPENDENT_CODE ON)

if(NOT CMAKE_BUILD_TYPE AND NOT CMAKE_CONFIGURATION_TYPES)
  set(CMAKE_BUILD_TYPE Release CACHE STRING "Build type" FORCE)
endif()

find_program(CCACHE_PROGRAM ccache)
if(CCACHE_PROGRAM AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
  set(CMAKE_CXX_COMPILER_LAUNCHER ${CCACHE_PROGRAM})
endif()

# Every target of ours links this.
add_library(usct_warnings INTERFACE)
target_compile_options(usct_warnings INTERFACE
  -Wall -Wextra -Wpedantic -Wshadow -Wnon-virtual-dtor -Woverloaded-virtual
  $<$<BOOL:${USCT_WERROR}>:-Werror>
  # GCC warns of a template with a type of an unnamed namespace unless it is in the file that is compiled; in a unit
  # (units.cmake) no file is.
  $<$<AND:$<BOOL:${USCT_UNITS}>,$<CXX_COMPILER_ID:GNU>>:-Wno-subobject-linkage>)
