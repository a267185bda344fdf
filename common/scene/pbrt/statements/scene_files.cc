// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/pbrt/statements/scene_files.h"

#include <algorithm>
#include <filesystem>
#include <memory>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/scene/formats/ies_reader.h"
#include "common/scene/formats/number.h"
#include "common/scene/formats/text_input.h"
#include "common/scene/pbrt/syntax/tokenizer.h"

namespace sheaf {
namespace {

constexpr uint64_t kSpectrumFileBytesMax = uint64_t{1} << 24;

absl::StatusOr<std::vector<float>> ReadSpectrumFile(const std::string& path) {
  absl::StatusOr<std::unique_ptr<TextInput>> input = TextInput::Open(path, kSpectrumFileBytesMax);
  if (!input.ok()) return input.status();
  Tokenizer tokens(std::move(*input));
  std::vector<float> numbers;
  while (true) {
    const Token token = tokens.Next();
    if (token.kind == Token::Kind::kEnd) return numbers;
    float value = 0;
    if (token.kind != Token::Kind::kWord || !ParseFloat(token.text, &value)) {
      return absl::InvalidArgumentError(
          absl::StrCat("line ", token.line, ", column ", token.column, ": expected a number"));
    }
    numbers.push_back(value);
  }
}

uint64_t SizeBytes(const std::vector<float>& numbers) { return numbers.size() * sizeof(float); }

}  // namespace

absl::Status SceneFiles::ChargeRepeated(uint64_t bytes) {
  repeated_bytes_ += bytes;
  if (repeated_bytes_ <= repeated_bytes_max_) return absl::OkStatus();
  return absl::ResourceExhaustedError(absl::StrCat(
      "files that were read before add up to more than the limit of ", repeated_bytes_max_,
      " bytes (repeated_bytes_max); name each in fewer statements: ",
      "define an object or a material once and use it by its name"));
}

absl::StatusOr<std::string> SceneFiles::PathToRead(const std::string& canonical_name,
                                                   uint64_t least_bytes) {
  absl::StatusOr<std::string> path = files_->LocalPath(canonical_name);
  if (!path.ok() || read_.insert(canonical_name).second) return path;
  std::error_code unknown;
  const uintmax_t bytes = std::filesystem::file_size(*path, unknown);
  const absl::Status status = ChargeRepeated(std::max<uint64_t>(unknown ? 0 : bytes, least_bytes));
  if (!status.ok()) return status;
  return path;
}

template <typename T, typename Read, typename Bytes>
absl::StatusOr<const T*> SceneFiles::Get(std::map<std::string, T>* known,
                                         const std::string& canonical_name, const Read& read,
                                         const Bytes& copied_bytes) {
  const auto found = known->find(canonical_name);
  if (found != known->end()) {
    const absl::Status status = ChargeRepeated(copied_bytes(found->second));
    if (!status.ok()) return status;
    return &found->second;
  }
  const absl::StatusOr<std::string> path = PathToRead(canonical_name);
  if (!path.ok()) return path.status();
  absl::StatusOr<T> content = read(*path);
  if (!content.ok()) return content.status();
  return &known->emplace(canonical_name, *std::move(content)).first->second;
}

absl::StatusOr<const std::vector<float>*> SceneFiles::SpectrumNumbers(
    const std::string& canonical_name) {
  return Get(&spectra_, canonical_name, &ReadSpectrumFile, &SizeBytes);
}

absl::StatusOr<const CandelaTable*> SceneFiles::Candelas(const std::string& canonical_name) {
  return Get(
      &candelas_, canonical_name,
      [&](const std::string& path) { return ReadIes(canonical_name, path); },
      [](const CandelaTable& table) {
        return SizeBytes(table.vertical_degrees) + SizeBytes(table.horizontal_degrees) +
               SizeBytes(table.candelas);
      });
}

absl::StatusOr<const MeasuredShape*> SceneFiles::MeasuredShapeOf(
    const std::string& canonical_name) {
  return Get(
      &measured_, canonical_name,
      [&](const std::string& path) { return ReadMeasuredShape(canonical_name, path); },
      [](const MeasuredShape&) { return uint64_t{sizeof(MeasuredShape)}; });
}

}  // namespace sheaf
