# Tests: one GoogleTest executable per folder of test/core, which mirrors src/core. They are not in
# `all`: `cmake --build build --target tests && ctest --test-dir build`.
if(USCT_CORE_ONLY)
  include(CTest)
  set(CATKIN_ENABLE_TESTING ${BUILD_TESTING})
  add_custom_target(tests)
endif()

if(CATKIN_ENABLE_TESTING)
  find_package(rapidcheck REQUIRED)
  if(USCT_CORE_ONLY)
    find_package(GTest REQUIRED)
  endif()
  if(USCT_BENCHMARKS)
    find_package(benchmark REQUIRED)
    add_subdirectory(bench)
  endif()
  include(cmake/add_tests.cmake)
endif()
