// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ConvertUsd: makes a .glb file of a USD scene, by Node.js in a process that has nothing but the
// scene's folder, for reading, and a pipe.
//
//     ConvertUsd | pipe | sheaf-usd-reader > node: UsdScript
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"

namespace sheaf::cli {

// Beside this program, or in ../lib/sheaf: confines itself, then becomes Node.js.
inline constexpr char kUsdReaderProgram[] = "sheaf-usd-reader";
// Limits of the process.
inline constexpr uint64_t kUsdMemoryBytesMax = uint64_t{8} << 30;
inline constexpr uint32_t kUsdCpuSecondsMax = 600;

// Whether the name ends in .usd, .usda, .usdc or .usdz, in letters of either case.
bool IsUsdName(const std::string& name);
// The name of a scene as it is read: for USD with .glb after it; others are as they are.
std::string NameAsRead(const std::string& name);

// The image that surrounds a scene.
struct UsdEnvironment {
  std::string image, ending;  // A file's bytes: equirectangular, as GltfArguments::environment.
  // Row by row: a direction of the image from one of the scene.
  std::array<double, 9> rotation{1, 0, 0, 0, 1, 0, 0, 0, 1};
  std::array<double, 3> scale{1, 1, 1};  // For red, green and blue.
};

struct UsdScene {
  std::string glb;
  // One line each: what glTF or the converter has no place for.
  std::vector<std::string> notes;
  std::optional<UsdEnvironment> environment;
};

// Errors: kFailedPrecondition if Node.js is missing, naming what to install; kInvalidArgument for a
// file that is broken, kResourceExhausted for one that exceeds a limit, in one line that begins
// with `path`. Thread safety: may be called concurrently.
absl::StatusOr<UsdScene> ConvertUsd(const std::string& path);

// The program that Node.js runs.
std::string_view UsdScript();

}  // namespace sheaf::cli
