# SPDX-License-Identifier: Apache-2.0
# Run by the build: copies FILES from one folder to another and keeps their relative paths. The
# folder ONLY, if given, is emptied first, so that no deleted file takes part in the build.
#
#   cmake -DFROM=... -DTO=... -DFILES=a;b [-DONLY=src] -P copy_files.cmake
if(ONLY)
  file(REMOVE_RECURSE ${TO}/${ONLY})
endif()
foreach(name IN LISTS FILES)
  get_filename_component(folder ${name} DIRECTORY)
  file(COPY ${FROM}/${name} DESTINATION ${TO}/${folder})
endforeach()
