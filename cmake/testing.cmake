# Tests: one GoogleTest executable per folder of test/core, which mirrors src/core. They are not in
# `all`: `cmake --build build --target tests && ctest --test-dir build`.
if(USCT_CORE_ONLY)
  include(CTest)
  set(USCT_BUILD_TESTS ${BUILD_TESTING})
  if(NOT TARGET tests)
    add_custom_target(tests)
  endif()
else()
  set(USCT_BUILD_TESTS ${CATKIN_ENABLE_TESTING})
endif()
if(NOT USCT_BUILD_TESTS)
  return()
endif()

find_package(rapidcheck REQUIRED)
if(USCT_CORE_ONLY)
  find_package(GTest REQUIRED)
endif()

# usct_add_gtest(NAME SOURCES...): with ROS through catkin, so that catkin_test_results sees it.
function(usct_add_gtest name)
  if(USCT_CORE_ONLY)
    add_executable(${name} EXCLUDE_FROM_ALL ${ARGN})
    target_link_libraries(${name} GTest::gtest GTest::gtest_main)
    add_dependencies(tests ${name})
    add_test(NAME ${name} COMMAND ${name}
      --gtest_output=xml:${PROJECT_BINARY_DIR}/test_results/${name}.xml)
  else()
    catkin_add_gtest(${name} ${ARGN} TIMEOUT 1200)
    target_link_libraries(${name} ${GTEST_MAIN_LIBRARIES} ${GTEST_LIBRARIES})
  endif()
  target_include_directories(${name} PRIVATE
    ${PROJECT_SOURCE_DIR}/test ${PROJECT_SOURCE_DIR}/src/core)
  target_include_directories(${name} SYSTEM PRIVATE ${ITK_INCLUDE_DIRS} ${OpenCV_INCLUDE_DIRS})
  target_link_libraries(${name} us_ct_registration_core rapidcheck OpenMP::OpenMP_CXX
    ${ITK_LIBRARIES} ${OpenCV_LIBS} ZLIB::ZLIB yaml-cpp nlohmann_json::nlohmann_json
    usct_warnings)
  target_compile_definitions(${name} PRIVATE
    USCT_SOURCE_DIR="${PROJECT_SOURCE_DIR}"
    USCT_TOOL="$<TARGET_FILE:usct>")
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

add_subdirectory(test/fuzz)
