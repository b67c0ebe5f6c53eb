# Installs libraries, headers, the tool and what it reads at run time.
include(GNUInstallDirs)

if(USCT_CORE_ONLY)
  set(USCT_LIB_DIR ${CMAKE_INSTALL_LIBDIR})
  set(USCT_BIN_DIR ${CMAKE_INSTALL_BINDIR})
  set(USCT_INCLUDE_DIR ${CMAKE_INSTALL_INCLUDEDIR}/${PROJECT_NAME})
  set(USCT_SHARE_DIR ${CMAKE_INSTALL_DATADIR}/${PROJECT_NAME})
  set(USCT_SCRIPT_DIR ${USCT_SHARE_DIR}/scripts)
else()
  set(USCT_LIB_DIR ${CATKIN_PACKAGE_LIB_DESTINATION})
  set(USCT_BIN_DIR ${CATKIN_GLOBAL_BIN_DESTINATION})
  set(USCT_INCLUDE_DIR ${CATKIN_PACKAGE_INCLUDE_DESTINATION})
  set(USCT_SHARE_DIR ${CATKIN_PACKAGE_SHARE_DESTINATION})
  set(USCT_SCRIPT_DIR ${CATKIN_PACKAGE_BIN_DESTINATION})  # rosrun us_ct_registration study_report
endif()

# The tool finds the library, and usct_bag beside it, wherever the prefix is.
set(USCT_PROGRAMS usct)
if(NOT USCT_CORE_ONLY)
  list(APPEND USCT_PROGRAMS usct_bag)
endif()
# Until version 1 each minor version may change the binary interface.
set_target_properties(${PROJECT_NAME}_core PROPERTIES
  VERSION ${PROJECT_VERSION} SOVERSION ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR})
set_target_properties(${USCT_PROGRAMS} PROPERTIES INSTALL_RPATH "$ORIGIN/../lib:$ORIGIN/../${USCT_LIB_DIR}")
install(TARGETS ${PROJECT_NAME}_core EXPORT ${PROJECT_NAME}_targets
  ARCHIVE DESTINATION ${USCT_LIB_DIR} LIBRARY DESTINATION ${USCT_LIB_DIR})
set_target_properties(${USCT_MODULES} PROPERTIES INSTALL_RPATH "$ORIGIN/..")
install(TARGETS ${USCT_MODULES} LIBRARY DESTINATION ${USCT_LIB_DIR}/${USCT_MODULE_FOLDER})
install(TARGETS ${USCT_PROGRAMS} RUNTIME DESTINATION ${USCT_BIN_DIR})
if(NOT USCT_CORE_ONLY)
  set_target_properties(${PROJECT_NAME}_ros PROPERTIES
    VERSION ${PROJECT_VERSION} SOVERSION ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR})
  set_target_properties(${PROJECT_NAME}_ros ${PROJECT_NAME}_nodelets ${PROJECT_NAME}_rviz
    PROPERTIES INSTALL_RPATH "$ORIGIN")
  set_target_properties(${USCT_NODES} PROPERTIES INSTALL_RPATH "$ORIGIN/..")
  install(TARGETS ${PROJECT_NAME}_ros ${PROJECT_NAME}_nodelets ${PROJECT_NAME}_rviz
    LIBRARY DESTINATION ${USCT_LIB_DIR})
  install(TARGETS ${USCT_NODES} RUNTIME DESTINATION ${CATKIN_PACKAGE_BIN_DESTINATION})
  install(FILES nodelet_plugins.xml rviz_plugins.xml DESTINATION ${USCT_SHARE_DIR})
  install(DIRECTORY launch rviz urdf DESTINATION ${USCT_SHARE_DIR})
endif()
install(DIRECTORY include/${PROJECT_NAME}/ DESTINATION ${USCT_INCLUDE_DIR})
install(DIRECTORY config studies DESTINATION ${USCT_SHARE_DIR})
install(PROGRAMS scripts/study_cases scripts/study_report scripts/study_slurm DESTINATION ${USCT_SCRIPT_DIR})

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
