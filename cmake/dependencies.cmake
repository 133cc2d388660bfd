# Every library that the project links, found once. Also installed: the package's config file includes it, so that a
# consumer finds what the project was built with. All are Debian 12 packages: scripts/packages.txt, third_party_notes.md.
find_package(Threads REQUIRED)
find_package(TBB REQUIRED)
find_package(PkgConfig REQUIRED)
find_package(yaml-cpp REQUIRED)
find_package(spdlog REQUIRED)
find_package(nlohmann_json REQUIRED)
pkg_check_modules(EIGEN3 REQUIRED IMPORTED_TARGET eigen3)
pkg_check_modules(HWY REQUIRED IMPORTED_TARGET libhwy)
pkg_check_modules(SPNG REQUIRED IMPORTED_TARGET spng)
pkg_check_modules(TURBOJPEG REQUIRED IMPORTED_TARGET libturbojpeg)
pkg_check_modules(BLOSC REQUIRED IMPORTED_TARGET blosc)
pkg_check_modules(DEFLATE REQUIRED IMPORTED_TARGET libdeflate)
pkg_check_modules(XXHASH REQUIRED IMPORTED_TARGET libxxhash)
pkg_check_modules(TIFF REQUIRED IMPORTED_TARGET libtiff-4>=4.5)
# OpenEXR's C library alone: it needs zlib and nothing else.
find_library(FELTMAP_OPENEXR_CORE OpenEXRCore REQUIRED)
find_path(FELTMAP_OPENEXR_INCLUDE OpenEXR/openexr.h REQUIRED)
if(NOT TARGET felt_openexr)
  add_library(felt_openexr INTERFACE IMPORTED)
  target_include_directories(felt_openexr SYSTEM INTERFACE "${FELTMAP_OPENEXR_INCLUDE}")
  target_link_libraries(felt_openexr INTERFACE "${FELTMAP_OPENEXR_CORE}")
endif()

# OpenVDB ships a find module instead of a config file.
if(NOT TARGET OpenVDB::openvdb)
  find_path(FELTMAP_OPENVDB_MODULE FindOpenVDB.cmake
            PATHS /usr/lib/${CMAKE_LIBRARY_ARCHITECTURE}/cmake/OpenVDB /usr/lib/cmake/OpenVDB REQUIRED)
  list(APPEND CMAKE_MODULE_PATH "${FELTMAP_OPENVDB_MODULE}")
  find_package(OpenVDB 10 REQUIRED COMPONENTS openvdb)
endif()

# Debian's OpenCVConfig names every module that was built; these are all we link.
foreach(module core imgproc imgcodecs dnn)
  find_library(FELTMAP_OPENCV_${module} opencv_${module} REQUIRED)
endforeach()
find_path(FELTMAP_OPENCV_INCLUDE opencv2/core.hpp PATH_SUFFIXES opencv4 REQUIRED)
# The product decodes images itself: opencv_imgcodecs brings GDAL and 110 more libraries, a fifth of a second at every
# start. Tests and benchmarks use it as the second decoder that ours is held against.
if(NOT TARGET felt_opencv)
  add_library(felt_opencv INTERFACE IMPORTED)
  target_include_directories(felt_opencv SYSTEM INTERFACE "${FELTMAP_OPENCV_INCLUDE}")
  target_link_libraries(felt_opencv INTERFACE ${FELTMAP_OPENCV_dnn} ${FELTMAP_OPENCV_imgproc} ${FELTMAP_OPENCV_core})
  add_library(felt_opencv_images INTERFACE IMPORTED)
  target_link_libraries(felt_opencv_images INTERFACE felt_opencv ${FELTMAP_OPENCV_imgcodecs})
endif()

# ONNX Runtime is optional: Debian 13 has libonnxruntime-dev; elsewhere unpack a release and pass its folder as
# -DFELTMAP_ONNXRUNTIME_ROOT=... (or leave it out: OpenCV runs the networks).
set(FELTMAP_ONNXRUNTIME_ROOT "" CACHE PATH "Folder of an ONNX Runtime release (include/, lib/)")
find_path(FELTMAP_ONNXRUNTIME_INCLUDE onnxruntime_cxx_api.h HINTS "${FELTMAP_ONNXRUNTIME_ROOT}/include"
          PATH_SUFFIXES onnxruntime onnxruntime/core/session)
find_library(FELTMAP_ONNXRUNTIME_LIBRARY onnxruntime HINTS "${FELTMAP_ONNXRUNTIME_ROOT}/lib")
if(FELTMAP_ONNXRUNTIME_INCLUDE AND FELTMAP_ONNXRUNTIME_LIBRARY AND NOT TARGET felt_onnxruntime)
  add_library(felt_onnxruntime INTERFACE IMPORTED)
  target_include_directories(felt_onnxruntime SYSTEM INTERFACE "${FELTMAP_ONNXRUNTIME_INCLUDE}")
  target_link_libraries(felt_onnxruntime INTERFACE "${FELTMAP_ONNXRUNTIME_LIBRARY}")
endif()
