# SPDX-License-Identifier: Apache-2.0
# All third-party libraries, each with its purpose. All come from Debian 12 or 13.
find_package(Threads REQUIRED)
find_package(absl REQUIRED)            # Status, StatusOr, string formatting
find_package(PkgConfig REQUIRED)
find_package(OpenSSL REQUIRED)         # SHA-256
find_package(ZLIB REQUIRED)            # gzipped scene files
find_package(PNG REQUIRED)             # PNG images
find_package(JPEG REQUIRED)            # JPEG textures
find_package(spdlog REQUIRED)          # logging
find_package(OpenEXR REQUIRED)         # film parts and EXR images
find_package(Protobuf REQUIRED)        # wire messages
find_package(CLI11 REQUIRED)           # command lines
find_package(nlohmann_json REQUIRED)   # JSON output
pkg_check_modules(gRPC REQUIRED IMPORTED_TARGET grpc++)
# Through pkg-config: the CMake package refers to tools and folders that Debian packages elsewhere.
pkg_check_modules(OpenImageIO REQUIRED IMPORTED_TARGET GLOBAL OpenImageIO)  # images
add_library(OpenImageIO::OpenImageIO ALIAS PkgConfig::OpenImageIO)
pkg_check_modules(OpenColorIO REQUIRED IMPORTED_TARGET GLOBAL OpenColorIO)  # display views
add_library(OpenColorIO::OpenColorIO ALIAS PkgConfig::OpenColorIO)
pkg_check_modules(sqlite3 REQUIRED IMPORTED_TARGET sqlite3)   # durable state
pkg_check_modules(libpq REQUIRED IMPORTED_TARGET libpq)       # durable state of several coordinators
pkg_check_modules(libcurl REQUIRED IMPORTED_TARGET libcurl)  # HTTP to object stores
find_path(TINYGLTF_INCLUDE_DIR tiny_gltf.h REQUIRED)  # glTF scenes; one header
pkg_check_modules(draco REQUIRED IMPORTED_TARGET GLOBAL draco)  # compressed meshes of glTF scenes
find_package(meshoptimizer REQUIRED)  # compressed buffers of glTF scenes
pkg_check_modules(tinyxml2 REQUIRED IMPORTED_TARGET tinyxml2)  # answers of object stores
pkg_check_modules(libseccomp REQUIRED IMPORTED_TARGET libseccomp)  # filters of system calls
pkg_check_modules(libarchive REQUIRED IMPORTED_TARGET GLOBAL libarchive)  # zip files
pkg_check_modules(zstd REQUIRED IMPORTED_TARGET libzstd)      # content transfer
pkg_check_modules(blosc REQUIRED IMPORTED_TARGET GLOBAL blosc)  # volume grids
find_path(SHEAF_NANOVDB nanovdb/NanoVDB.h REQUIRED)           # form for lookups, header-only
find_library(SHEAF_OPENVDB openvdb REQUIRED)                  # .vdb files
find_package(TBB REQUIRED)                                    # OpenVDB's threads
find_package(embree 4 QUIET)           # ray intersection; 4.x on Debian 13
if(NOT embree_FOUND)
  find_package(embree 3 REQUIRED)      # 3.13 on Debian 12
endif()
find_program(SHEAF_GRPC_PLUGIN grpc_cpp_plugin REQUIRED)
if(SHEAF_BUILD_TESTS)
  find_package(GTest REQUIRED)
  find_package(benchmark REQUIRED)
  find_program(SHEAF_TEST_LINKER ld.gold)  # Links a test in a third of the time, if available.
endif()
