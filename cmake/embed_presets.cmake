# Makes the presets part of the library: config/presets/*.yaml is the only place where their values
# stand, and the library finds them wherever it is.
file(GLOB preset_files CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/config/presets/*.yaml)
set(USCT_PRESETS "")
foreach(file ${preset_files})
  set_property(DIRECTORY ${PROJECT_SOURCE_DIR} APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${file})
  get_filename_component(name ${file} NAME_WE)
  file(READ ${file} text)
  string(APPEND USCT_PRESETS "    {\"${name}\", R\"usct_yaml(${text})usct_yaml\"},\n")
endforeach()
configure_file(${PROJECT_SOURCE_DIR}/cmake/embedded_presets.cpp.in
  ${PROJECT_BINARY_DIR}/generated/embedded_presets.cpp @ONLY)
set(USCT_GENERATED_SOURCES ${PROJECT_BINARY_DIR}/generated/embedded_presets.cpp)
