# SPDX-License-Identifier: Apache-2.0
# Helpers for build scripts that embed files in programs.

# sheaf_read_bytes(VARIABLE PATH): the file as the elements of a C++ array, "0x3c,0x21,...".
function(sheaf_read_bytes variable path)
  file(READ ${path} bytes HEX)
  string(REGEX REPLACE "([0-9a-f][0-9a-f])" "0x\\1," bytes "${bytes}")
  # Lines of 8 bytes keep the file readable by tools.
  string(REPEAT "0x..," 8 eight_bytes)
  string(REGEX REPLACE "(${eight_bytes})" "\\1\n" bytes "${bytes}")
  set(${variable} "${bytes}" PARENT_SCOPE)
endfunction()
