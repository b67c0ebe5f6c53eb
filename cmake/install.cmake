# Installs libraries, headers, the tool and what it reads at run time.
include(GNUInstallDirs)

if(USCT_CORE_ONLY)
  set(USCT_LIB_DIR ${CMAKE_INSTALL_LIBDIR})
  set(USCT_BIN_DIR ${CMAKE_INSTALL_BINDIR})
  set(USCT_INCLUDE_DIR ${CMAKE_INSTALL_INCLUDEDIR}/${PROJECT_NAME})
  set(USCT_SHARE_DIR ${CMAKE_INSTALL_DATADIR}/${PROJECT_NAME})
else()
  set(USCT_LIB_DIR ${CATKIN_PACKAGE_LIB_DESTINATION})
  set(USCT_BIN_DIR ${CATKIN_GLOBAL_BIN_DESTINATION})
  set(USCT_INCLUDE_DIR ${CATKIN_PACKAGE_INCLUDE_DESTINATION})
  set(USCT_SHARE_DIR ${CATKIN_PACKAGE_SHARE_DESTINATION})
endif()

# The tool finds the library beside it wherever the prefix is.
set_target_properties(usct PROPERTIES INSTALL_RPATH "$ORIGIN/../lib:$ORIGIN/../${USCT_LIB_DIR}")
install(TARGETS ${PROJECT_NAME}_core EXPORT ${PROJECT_NAME}_targets
  ARCHIVE DESTINATION ${USCT_LIB_DIR} LIBRARY DESTINATION ${USCT_LIB_DIR})
install(TARGETS usct RUNTIME DESTINATION ${USCT_BIN_DIR})
if(NOT USCT_CORE_ONLY)
  install(TARGETS ${PROJECT_NAME}_ros LIBRARY DESTINATION ${USCT_LIB_DIR})
endif()
install(DIRECTORY include/${PROJECT_NAME}/ DESTINATION ${USCT_INCLUDE_DIR})
install(DIRECTORY config DESTINATION ${USCT_SHARE_DIR})

# With ROS, catkin_package() makes the files that find_package(us_ct_registration) reads.
if(USCT_CORE_ONLY)
  include(CMakePackageConfigHelpers)
  set(USCT_CMAKE_DIR ${CMAKE_INSTALL_LIBDIR}/cmake/${PROJECT_NAME})
  install(EXPORT ${PROJECT_NAME}_targets NAMESPACE ${PROJECT_NAME}::
    DESTINATION ${USCT_CMAKE_DIR})
  configure_package_config_file(cmake/${PROJECT_NAME}Config.cmake.in
    ${PROJECT_BINARY_DIR}/${PROJECT_NAME}Config.cmake INSTALL_DESTINATION ${USCT_CMAKE_DIR})
  write_basic_package_version_file(
    ${PROJECT_BINARY_DIR}/${PROJECT_NAME}ConfigVersion.cmake COMPATIBILITY SameMinorVersion)
  # The linter expects catkin's paths and does not know that the two files are made just above.
  #catkin_lint: ignore_once missing_file wrong_install_destination
  install(FILES ${PROJECT_BINARY_DIR}/${PROJECT_NAME}Config.cmake
    ${PROJECT_BINARY_DIR}/${PROJECT_NAME}ConfigVersion.cmake DESTINATION ${USCT_CMAKE_DIR})
endif()
