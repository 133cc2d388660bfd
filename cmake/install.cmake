# Installs the libraries and headers as the package `feltmap` with targets feltmap::core ... feltmap::io.
get_property(modules GLOBAL PROPERTY FELTMAP_MODULES)
if(TARGET feltmap)
  install(TARGETS feltmap RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
endif()
