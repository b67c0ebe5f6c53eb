# ITK's readers of images and transforms, to which tests hold ours. The core does not link them.
find_package(ITK 5 REQUIRED COMPONENTS ITKHDF5 ITKIOTransformInsightLegacy ITKIOTransformHDF5)
set(transform_includes ${ITK_INCLUDE_DIRS})
find_package(ITK 5 REQUIRED COMPONENTS ITKIOImageBase ITKIOMeta ITKIONRRD ITKIONIFTI)

# Where tests find the project's files and the tool. A header rather than macros on the command line: tests
# that do not include it compile to the same objects in any folder.
file(GENERATE OUTPUT ${PROJECT_BINARY_DIR}/test_paths/test_paths.h CONTENT "#pragma once

#define USCT_SOURCE_DIR \"${PROJECT_SOURCE_DIR}\"
#define USCT_TOOL \"$<TARGET_FILE:usct>\"
")

# What tests cost is mostly their compilation; what they call is compiled as a user's is. With so little optimization, g++
# takes elements of Eigen's vectors for uninitialized.
set(test_optimization $<$<CONFIG:Release>:-O1> $<$<CONFIG:Release>:-Wno-maybe-uninitialized>)

# usct_add_gtest(NAME SOURCES...): with ROS through catkin, so that catkin_test_results sees it.
function(usct_add_gtest name)
  set(sources ${ARGN})
  usct_unite(sources ${PROJECT_SOURCE_DIR}/test)
  if(USCT_CORE_ONLY)
    add_executable(${name} EXCLUDE_FROM_ALL ${sources})
    target_link_libraries(${name} GTest::gtest GTest::gtest_main)
    add_dependencies(tests ${name})
    add_test(NAME ${name} COMMAND ${name}
      --gtest_output=xml:${PROJECT_BINARY_DIR}/test_results/${name}.xml)
  else()
    catkin_add_gtest(${name} ${sources})
    target_link_libraries(${name} ${GTEST_MAIN_LIBRARIES} ${GTEST_LIBRARIES})
  endif()
  target_include_directories(${name} PRIVATE
    ${PROJECT_SOURCE_DIR}/test ${PROJECT_SOURCE_DIR}/src/core ${PROJECT_BINARY_DIR}/test_paths)
  target_include_directories(${name} SYSTEM PRIVATE
    ${ITK_INCLUDE_DIRS} ${GDCM_INCLUDE_DIRS} ${OpenCV_INCLUDE_DIRS})
  target_link_libraries(${name} ${PROJECT_NAME}_core rapidcheck
    ${ITK_LIBRARIES} gdcmMSFF gdcmDSED gdcmCommon ${OpenCV_LIBS} ZLIB::ZLIB yaml-cpp nlohmann_json::nlohmann_json
    hwy::hwy usct_warnings)
  target_compile_options(${name} PRIVATE ${test_optimization})
  add_dependencies(${name} usct)
endfunction()

file(GLOB test_folders CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/test/core/*)
foreach(folder ${test_folders})
  file(GLOB sources CONFIGURE_DEPENDS ${folder}/*.cpp)
  if(sources)
    get_filename_component(name ${folder} NAME)
    usct_add_gtest(test_${name} ${sources})
  endif()
endforeach()
target_include_directories(test_io SYSTEM PRIVATE ${transform_includes})
target_link_libraries(test_io ITKIOTransformInsightLegacy ITKIOTransformHDF5 ${HDF5_LIBRARIES})
# The tools are tested as programs, but for what a signal ends at a moment that only a test's own program knows.
target_include_directories(test_tools PRIVATE ${PROJECT_SOURCE_DIR}/src)
target_link_libraries(test_tools usct_tools)

# The ROS interface: test/ros/unit needs no master (one executable, test_ros); each NAME.test beside it
# launches nodes, with its own test program from the sources in the folder NAME if there is one.
if(NOT USCT_CORE_ONLY)
  find_package(rostest REQUIRED)
  # catkin fixes the tests' environment while it configures and leaves out folders that do not exist yet: without
  # this, the tests of a first build would not find the messages' Python modules.
  file(MAKE_DIRECTORY ${CATKIN_DEVEL_PREFIX}/${CATKIN_GLOBAL_PYTHON_DESTINATION})
  safe_execute_process(COMMAND ${GENERATE_ENVIRONMENT_CACHE_COMMAND})
  file(GLOB sources CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/test/ros/unit/*.cpp)
  usct_add_gtest(test_ros ${sources})
  target_link_libraries(test_ros ${PROJECT_NAME}_ros gmock)
  file(GLOB launch_files CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/test/ros/*.test)
  foreach(launch_file ${launch_files})
    get_filename_component(name ${launch_file} NAME_WE)
    file(GLOB sources CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/test/ros/${name}/*.cpp)
    if(sources)
      usct_unite(sources ${PROJECT_SOURCE_DIR}/test)
      add_rostest_gtest(test_${name} ${launch_file} ${sources})
      target_include_directories(test_${name} PRIVATE ${PROJECT_SOURCE_DIR}/test)
      target_compile_options(test_${name} PRIVATE ${test_optimization})
      target_link_libraries(test_${name} ${PROJECT_NAME}_ros ${GTEST_LIBRARIES} usct_warnings)
    else()
      add_rostest(${launch_file})
    endif()
  endforeach()
endif()

# The panel, as rviz loads it; its buttons are pressed by Qt's own means.
if(NOT USCT_CORE_ONLY)
  find_package(Qt5 REQUIRED COMPONENTS Test)
  target_include_directories(test_rviz_panel SYSTEM PRIVATE ${rviz_INCLUDE_DIRS})
  target_link_libraries(test_rviz_panel rviz Qt5::Widgets Qt5::Test gmock)
  add_dependencies(test_rviz_panel ${PROJECT_NAME}_rviz)
endif()

# Tests with nodes run two at a time: they wait for messages, within limits that a machine with many of them at once
# would not keep. The longest one, replay, runs beside them: it is idle most of the time, and its own limits are minutes.
# They start first (ctest starts the greatest COST first): tests that compute fill the time in which they wait.
get_property(all_tests DIRECTORY PROPERTY TESTS)
# The second lane takes about as long as the first, which has all others.
set(second_lane "integration|real_data|us_ingest")
foreach(test ${all_tests})
  if(test MATCHES "_rostest_.*replay")
    set_tests_properties(${test} PROPERTIES COST 2000)
  elseif(test MATCHES "_rostest_.*(${second_lane})")
    set_tests_properties(${test} PROPERTIES RESOURCE_LOCK nodes_b COST 1000)
  elseif(test MATCHES "_rostest_")
    set_tests_properties(${test} PROPERTIES RESOURCE_LOCK nodes_a COST 1000)
  endif()
endforeach()

# The package itself: what it promises to a stranger who builds it.
find_package(Python3 REQUIRED COMPONENTS Interpreter)
set(package_tests ${PROJECT_SOURCE_DIR}/test/package)
add_test(NAME package_dependencies
  COMMAND ${Python3_EXECUTABLE} ${package_tests}/check_dependencies.py ${PROJECT_SOURCE_DIR})
add_test(NAME package_debian COMMAND ${Python3_EXECUTABLE} ${package_tests}/check_debian.py ${PROJECT_SOURCE_DIR})
add_test(NAME package_check_debian COMMAND ${Python3_EXECUTABLE} ${package_tests}/test_check_debian.py)
add_test(NAME package_core_without_ros
  COMMAND ${Python3_EXECUTABLE} ${package_tests}/check_core_without_ros.py ${PROJECT_SOURCE_DIR}
    $<TARGET_FILE:${PROJECT_NAME}_core> $<TARGET_FILE:usct>)
add_test(NAME package_headers
  COMMAND ${Python3_EXECUTABLE} ${package_tests}/check_headers.py ${PROJECT_SOURCE_DIR}
    ${CMAKE_CXX_COMPILER} ${EIGEN3_INCLUDE_DIRS})
add_test(NAME package_sizes
  COMMAND ${Python3_EXECUTABLE} ${package_tests}/check_sizes.py ${PROJECT_SOURCE_DIR})
add_test(NAME package_check_sizes COMMAND ${Python3_EXECUTABLE} ${package_tests}/test_check_sizes.py)
add_test(NAME package_study_report COMMAND ${Python3_EXECUTABLE} ${package_tests}/test_study_report.py)
add_test(NAME package_study_cases COMMAND ${Python3_EXECUTABLE} ${package_tests}/test_study_cases.py)
add_test(NAME package_overlay_error COMMAND ${Python3_EXECUTABLE} ${package_tests}/test_overlay_error.py)
add_test(NAME package_summarise_tests COMMAND ${Python3_EXECUTABLE} ${package_tests}/test_summarise_tests.py)
add_test(NAME peer_geometry COMMAND ${PROJECT_SOURCE_DIR}/bench/peer/test_geometry.py)
add_test(NAME confidence_self_cases COMMAND ${PROJECT_SOURCE_DIR}/bench/confidence/test_self_cases.py)
add_test(NAME confidence_altered_cases COMMAND ${PROJECT_SOURCE_DIR}/bench/confidence/test_altered_cases.py)
add_test(NAME soak_watcher COMMAND ${Python3_EXECUTABLE} ${PROJECT_SOURCE_DIR}/bench/soak/test_soak.py)
if(NOT USCT_CORE_ONLY)
  add_test(NAME package_launch_files
    COMMAND ${Python3_EXECUTABLE} ${package_tests}/test_launch_files.py)
  set_tests_properties(package_launch_files PROPERTIES
    ENVIRONMENT ROS_PACKAGE_PATH=${PROJECT_SOURCE_DIR})
  add_test(NAME package_format COMMAND ${package_tests}/check_format.sh ${PROJECT_SOURCE_DIR})
  add_test(NAME package_catkin_lint COMMAND catkin_lint --strict ${PROJECT_SOURCE_DIR})
  foreach(variant cmake core_only catkin_make catkin_build)
    add_test(NAME package_built_by_${variant}
      COMMAND ${package_tests}/build_variants.sh
        ${PROJECT_SOURCE_DIR} ${PROJECT_BINARY_DIR} ${variant})
    set_tests_properties(package_built_by_${variant} PROPERTIES RESOURCE_LOCK package_workspace)
  endforeach()
  # Not by default: it compiles what ccache does not have, and links and packs everything once more.
  if(USCT_TEST_DEBIAN)
    add_test(NAME package_debian_packages
      COMMAND ${package_tests}/debian_packages.sh ${PROJECT_SOURCE_DIR} ${PROJECT_BINARY_DIR})
    set_tests_properties(package_debian_packages PROPERTIES
      RESOURCE_LOCK package_workspace SKIP_REGULAR_EXPRESSION "^skipped:")
  endif()
endif()
