# One function sets standard, warnings and includes for every target of the project.
function(feltmap_compile_options target)
  target_compile_features(${target} PUBLIC cxx_std_20)
  set_target_properties(${target} PROPERTIES CXX_EXTENSIONS OFF POSITION_INDEPENDENT_CODE ON)
  # -ffp-contract=off: the scalar code is the specification, and every SIMD target must round as it does.
  # restrict, stringop-overflow, stringop-overread, array-bounds: GCC 12 reports copies within std::string that cannot happen (GCC bug 105651).
  # psabi: Eigen values passed by value warn about an ABI that no caller of ours depends on.
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wshadow -Wno-psabi "$<$<CXX_COMPILER_ID:GNU>:-Wno-restrict;-Wno-stringop-overflow;-Wno-array-bounds;-Wno-stringop-overread>" -ffp-contract=off
                         $<$<BOOL:${FELTMAP_WARNINGS_AS_ERRORS}>:-Werror>)
  if(CCACHE AND FELTMAP_PCH)
    target_compile_options(${target} PRIVATE $<$<CXX_COMPILER_ID:GNU>:-fpch-preprocess>)
  endif()
  if(FELTMAP_SANITIZE)
    target_compile_options(${target} PRIVATE -fsanitize=${FELTMAP_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=undefined)
    target_link_options(${target} PUBLIC -fsanitize=${FELTMAP_SANITIZE})
  endif()
  if(FELTMAP_BUILD_FUZZ)
    target_compile_options(${target} PRIVATE -fsanitize=fuzzer-no-link)
  endif()
  if(MOLD AND PROJECT_IS_TOP_LEVEL)
    target_link_options(${target} PRIVATE -fuse-ld=mold)
  endif()
endfunction()

# feltmap_module(<name> DEPENDS <targets...>): the library felt_<name>, alias felt::<name>, of every .cpp in the
# folder that calls it. Headers lie beside their sources and are included from the root.
function(feltmap_module name)
  cmake_parse_arguments(ARG "" "" "DEPENDS;PRIVATE_DEPENDS;PCH" ${ARGN})
  file(GLOB_RECURSE sources CONFIGURE_DEPENDS "${CMAKE_CURRENT_SOURCE_DIR}/*.cpp")
  add_library(felt_${name} STATIC ${sources})
  if(FELTMAP_BUILD_FUZZ)
    # Vector kernels read no files, and clang takes minutes to instrument each.
    set(kernels ${sources})
    list(FILTER kernels INCLUDE REGEX "_kernels_simd\\.cpp$")
    set_source_files_properties(${kernels} PROPERTIES COMPILE_OPTIONS -fno-sanitize=all)
  endif()
  add_library(felt::${name} ALIAS felt_${name})
  set_target_properties(felt_${name} PROPERTIES EXPORT_NAME ${name})
  target_include_directories(felt_${name} PUBLIC "$<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}>"
                             "$<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}/feltmap>")
  target_link_libraries(felt_${name} PUBLIC ${ARG_DEPENDS} PRIVATE ${ARG_PRIVATE_DEPENDS})
  feltmap_compile_options(felt_${name})
  if(ARG_PCH AND FELTMAP_PCH)
    target_precompile_headers(felt_${name} PRIVATE ${ARG_PCH})
  endif()
  set_property(GLOBAL APPEND PROPERTY FELTMAP_MODULES felt_${name})
endfunction()
