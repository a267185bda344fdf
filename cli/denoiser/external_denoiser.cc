// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/denoiser/external_denoiser.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "cli/denoiser/user_command.h"
#include "common/base/file.h"
#include "common/base/status.h"
#include "common/film/exr/exr_codec.h"
#include "common/film/exr/external_layer.h"

namespace sheaf::cli {
namespace {

namespace fs = std::filesystem;

// Holds the denoiser's files; removed at the end.
class ExchangeFolder {
 public:
  static absl::StatusOr<std::unique_ptr<ExchangeFolder>> Make() {
    const char* const parent = std::getenv("TMPDIR");
    std::string path = absl::StrCat(parent == nullptr || parent[0] == '\0' ? "/tmp" : parent,
                                    "/sheaf-denoise-XXXXXX");
    if (::mkdtemp(path.data()) == nullptr) {
      return StatusFromErrno(
          errno, absl::StrCat("creating a folder ", path, " (choose another with TMPDIR)"));
    }
    return std::unique_ptr<ExchangeFolder>(new ExchangeFolder(std::move(path)));
  }
  ~ExchangeFolder() {
    std::error_code ignored;  // Files left in a temporary folder are harmless.
    fs::remove_all(path_, ignored);
  }
  ExchangeFolder(const ExchangeFolder&) = delete;
  ExchangeFolder& operator=(const ExchangeFolder&) = delete;
  std::string File(const std::string& name) const { return absl::StrCat(path_, "/", name); }

 private:
  explicit ExchangeFolder(std::string path) : path_(std::move(path)) {}
  const std::string path_;
};

absl::StatusOr<std::array<std::vector<float>, 3>> ReadResult(const std::string& path,
                                                             const FrameImage& image) {
  std::error_code error;
  if (!fs::is_regular_file(path, error)) {
    return absl::FailedPreconditionError(
        "ended without an error, but did not write its last argument, the EXR OUTPUT");
  }
  absl::StatusOr<FrameImage> made = ReadFrameImage(path);
  if (!made.ok()) {
    return absl::FailedPreconditionError(absl::StrCat(
        "wrote no EXR with R, G and B that can be read (", made.status().message(), ")"));
  }
  const auto size_of = [](const FrameImage& of) {
    return absl::StrCat(of.window.Width(), "x", of.window.Height());
  };
  if (size_of(*made) != size_of(image)) {
    return absl::FailedPreconditionError(absl::StrCat(
        "wrote an image of ", size_of(*made), " pixels, but this one has ", size_of(image)));
  }
  std::array<std::vector<float>, 3> planes;
  int64_t wrong = 0;
  for (size_t i = 0; i < planes.size(); ++i) {
    planes[i] = std::move(*made->Find(std::string(1, "RGB"[i])));
    wrong += std::ranges::count_if(planes[i], [](float value) { return !std::isfinite(value); });
  }
  if (wrong == 0) return planes;
  return absl::FailedPreconditionError(
      absl::StrCat("wrote ", wrong, " values that are not finite"));
}

absl::StatusOr<std::array<std::vector<float>, 3>> RunDenoiser(std::vector<std::string> words,
                                                              std::string_view delivered,
                                                              absl::Duration time_max,
                                                              const std::stop_token& stop,
                                                              const FrameImage& image) {
  const absl::StatusOr<std::unique_ptr<ExchangeFolder>> folder = ExchangeFolder::Make();
  if (!folder.ok()) return absl::FailedPreconditionError(folder.status().message());
  const std::string input = (*folder)->File("input.exr"), output = (*folder)->File("output.exr");
  if (const absl::Status status = WriteFileOnce(input, delivered); !status.ok()) {
    return absl::FailedPreconditionError(status.message());
  }
  words.insert(words.end(), {input, output});
  absl::Status status = RunCommand(words, (*folder)->File("log"), time_max, stop);
  if (!status.ok()) return status;
  return ReadResult(output, image);
}

}  // namespace

absl::Status CheckDenoiser(const std::string& command) {
  if (command.empty()) return absl::OkStatus();
  return Annotate(ParseCommand(command).status(), "--denoise-with");
}

absl::Status AddExternalLayer(const std::string& command, std::string_view delivered,
                              absl::Duration time_max, const std::stop_token& stop,
                              FrameImage* image) {
  absl::StatusOr<std::vector<std::string>> words = ParseCommand(command);
  if (!words.ok()) return absl::FailedPreconditionError(words.status().message());
  absl::StatusOr<std::array<std::vector<float>, 3>> planes =
      RunDenoiser(*std::move(words), delivered, time_max, stop, *image);
  if (!planes.ok()) return Annotate(planes.status(), command);
  SetExternalLayer(*std::move(planes), image);
  image->metadata[kExternalDenoiserKey] = command;
  return absl::OkStatus();
}

}  // namespace sheaf::cli
