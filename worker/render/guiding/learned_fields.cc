// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/guiding/learned_fields.h"

#include <algorithm>
#include <cstdint>
#include <utility>

namespace sheaf::render {
namespace {

constexpr size_t kSizeBytes = 8;

// The bytes, after their number.
void AppendSized(const std::string& bytes, std::string* to) {
  const uint64_t size = bytes.size();
  for (size_t i = 0; i < kSizeBytes; ++i) to->push_back(static_cast<char>(size >> (8 * i)));
  to->append(bytes);
}

absl::StatusOr<std::string_view> TakeSized(std::string_view* bytes) {
  if (bytes->size() < kSizeBytes) return absl::DataLossError("learned fields end too early");
  uint64_t size = 0;
  for (size_t i = 0; i < kSizeBytes; ++i) {
    size |= static_cast<uint64_t>(static_cast<unsigned char>((*bytes)[i])) << (8 * i);
  }
  bytes->remove_prefix(kSizeBytes);
  if (size > bytes->size()) return absl::DataLossError("learned fields end too early");
  const std::string_view taken = bytes->substr(0, size);
  bytes->remove_prefix(size);
  return taken;
}

}  // namespace

std::string LearnedFields::Encode() const {
  std::string bytes;
  AppendSized(directions.Encode(), &bytes);
  AppendSized(lights.Encode(), &bytes);
  if (!contributions.empty() || !emission.empty()) {
    AppendSized(contributions.empty() ? "" : contributions.Encode(), &bytes);
  }
  if (!emission.empty()) AppendSized(emission.Encode(), &bytes);
  return bytes;
}

absl::StatusOr<LearnedFields> LearnedFields::Decode(std::string_view bytes,
                                                    const LightChoice& choice,
                                                    uint32_t emitting_count) {
  const absl::StatusOr<std::string_view> of_directions = TakeSized(&bytes);
  if (!of_directions.ok()) return of_directions.status();
  const absl::StatusOr<std::string_view> of_lights = TakeSized(&bytes);
  if (!of_lights.ok()) return of_lights.status();
  ContributionField contributions;
  if (!bytes.empty()) {
    const absl::StatusOr<std::string_view> of_contributions = TakeSized(&bytes);
    if (!of_contributions.ok()) return of_contributions.status();
    if (!of_contributions->empty()) {
      absl::StatusOr<ContributionField> decoded = ContributionField::Decode(*of_contributions);
      if (!decoded.ok()) return decoded.status();
      contributions = *std::move(decoded);
    }
  }
  EmissionField emission;
  if (!bytes.empty()) {
    const absl::StatusOr<std::string_view> of_emission = TakeSized(&bytes);
    if (!of_emission.ok()) return of_emission.status();
    absl::StatusOr<EmissionField> decoded = EmissionField::Decode(*of_emission, emitting_count);
    if (!decoded.ok()) return decoded.status();
    emission = *std::move(decoded);
  }
  if (!bytes.empty()) return absl::DataLossError("learned fields are followed by other bytes");
  absl::StatusOr<GuidingField> directions = GuidingField::Decode(*of_directions);
  if (!directions.ok()) return directions.status();
  absl::StatusOr<LightVisibility> lights = LightVisibility::Decode(*of_lights, choice);
  if (!lights.ok()) return lights.status();
  if (std::max(lights->region_count(), contributions.region_count()) > directions->region_count()) {
    return absl::DataLossError("learned fields disagree about the number of regions");
  }
  return LearnedFields{*std::move(directions), *std::move(lights), std::move(contributions),
                       std::move(emission)};
}

}  // namespace sheaf::render
