// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// What fuzz targets share: a macro that defines one, and files in memory for readers of files. A
// target is one source NAME_fuzz.cc. It gets arbitrary bytes, gives them to a reader, and stops the
// process by SHEAF_CHECK if the reader accepts something that its callers could not handle.
#pragma once

#include <sys/mman.h>
#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "common/base/check.h"

namespace sheaf::testing {

using FuzzFunction = void (*)(std::string_view bytes);
// Adds a target to those of fuzz_replay, in which all are linked. Called before main.
bool AddFuzzTarget(const char* name, FuzzFunction function);

// A file in memory that can be opened by its path while the object lives.
class MemoryFile {
 public:
  explicit MemoryFile(std::string_view bytes) : descriptor_(::memfd_create("fuzz", MFD_CLOEXEC)) {
    SHEAF_CHECK(descriptor_ >= 0);
    SHEAF_CHECK(::write(descriptor_, bytes.data(), bytes.size()) ==
                static_cast<ssize_t>(bytes.size()));
  }
  ~MemoryFile() { ::close(descriptor_); }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;
  std::string Path() const { return "/proc/self/fd/" + std::to_string(descriptor_); }

 private:
  int descriptor_;
};

// Takes the first byte from the input, for targets that read several kinds; 0 from an empty one.
inline uint8_t TakeByte(std::string_view* bytes) {
  if (bytes->empty()) return 0;
  const auto first = static_cast<uint8_t>(bytes->front());
  bytes->remove_prefix(1);
  return first;
}

}  // namespace sheaf::testing

// Defines the target NAME, whose body follows and sees std::string_view bytes: the entry point of a
// libFuzzer program, or one target of fuzz_replay.
#ifdef SHEAF_LIBFUZZER
#define SHEAF_FUZZ_TARGET(name)                                                     \
  static void Fuzz_##name(std::string_view bytes);                                  \
  extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size_bytes) {   \
    Fuzz_##name(std::string_view(reinterpret_cast<const char*>(data), size_bytes)); \
    return 0;                                                                       \
  }                                                                                 \
  static void Fuzz_##name(std::string_view bytes)
#else
#define SHEAF_FUZZ_TARGET(name)                             \
  static void Fuzz_##name(std::string_view bytes);          \
  [[maybe_unused]] static const bool added_##name =         \
      ::sheaf::testing::AddFuzzTarget(#name, &Fuzz_##name); \
  static void Fuzz_##name(std::string_view bytes)
#endif
