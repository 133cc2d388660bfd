# Installs the command, and the libraries and headers as the package `feltmap` with the targets feltmap::core,
# feltmap::inference, feltmap::mapping and feltmap::io.
include(CMakePackageConfigHelpers)
include(GNUInstallDirs)

set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/feltmap)
get_property(modules GLOBAL PROPERTY FELTMAP_MODULES)
install(TARGETS ${modules} EXPORT feltmapTargets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT development)
install(EXPORT feltmapTargets NAMESPACE feltmap:: DESTINATION ${package_dir} COMPONENT development)
foreach(module ${modules})
  string(REPLACE "felt_" "" folder ${module})
  install(DIRECTORY ${PROJECT_SOURCE_DIR}/${folder} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/feltmap COMPONENT development
          FILES_MATCHING PATTERN "*.h")
endforeach()

configure_package_config_file(${CMAKE_CURRENT_LIST_DIR}/feltmapConfig.cmake.in ${PROJECT_BINARY_DIR}/feltmapConfig.cmake
                              INSTALL_DESTINATION ${package_dir} NO_SET_AND_CHECK_MACRO)
write_basic_package_version_file(${PROJECT_BINARY_DIR}/feltmapConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/feltmapConfig.cmake ${PROJECT_BINARY_DIR}/feltmapConfigVersion.cmake
              ${CMAKE_CURRENT_LIST_DIR}/dependencies.cmake
        DESTINATION ${package_dir} COMPONENT development)
install(FILES ${PROJECT_SOURCE_DIR}/LICENSE ${PROJECT_SOURCE_DIR}/third_party_notes.md DESTINATION ${CMAKE_INSTALL_DOCDIR})
if(TARGET feltmap)
  install(TARGETS feltmap RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
endif()
