// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/id_planes.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/escaping.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_split.h"
#include "common/math/double_float.h"

namespace sheaf {
namespace {

constexpr size_t kPlanesPerId = 3;

}  // namespace

std::string IdPlaneName(IdKind kind, size_t plane) {
  static constexpr const char* kParts[kPlanesPerId] = {"id", "W", "lo"};
  return absl::StrFormat("ids.%s.%03d.%s", IdKindName(kind), plane / kPlanesPerId,
                         kParts[plane % kPlanesPerId]);
}

bool IsIdPlaneName(IdKind kind, std::string_view name) {
  return name.starts_with(absl::StrCat("ids.", IdKindName(kind), "."));
}

std::vector<std::vector<float>> IdPlanes(const IdSums& ids) {
  size_t length = 0;
  for (const IdList& list : ids.pixels) length = std::max(length, list.size());
  std::vector<std::vector<float>> planes(kPlanesPerId * length,
                                         std::vector<float>(ids.pixels.size()));
  for (size_t p = 0; p < ids.pixels.size(); ++p) {
    for (size_t k = 0; k < ids.pixels[p].size(); ++k) {
      const DoubleFloat weight = DoubleFloat::Make(ids.pixels[p][k].weight);
      planes[kPlanesPerId * k][p] = static_cast<float>(ids.pixels[p][k].id + 1);
      planes[kPlanesPerId * k + 1][p] = weight.hi;
      planes[kPlanesPerId * k + 2][p] = weight.lo;
    }
  }
  return planes;
}

std::string NamesText(const std::map<uint32_t, std::string>& names) {
  std::string text;
  for (const auto& [id, name] : names) {
    absl::StrAppend(&text, id, " ", absl::CEscape(name), "\n");
  }
  return text;
}

namespace {

absl::Status ReadNames(const std::string& text, std::map<uint32_t, std::string>* names) {
  const std::vector<std::string> lines = absl::StrSplit(text, '\n', absl::SkipEmpty());
  for (const std::string& line : lines) {
    const size_t space = line.find(' ');
    uint32_t id = 0;
    std::string name;
    if (space == std::string::npos || !absl::SimpleAtoi(line.substr(0, space), &id) ||
        !absl::CUnescape(line.substr(space + 1), &name) || !names->emplace(id, name).second) {
      return absl::InvalidArgumentError("a name of an id cannot be read");
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status ReadIds(const std::string& names_text, const std::vector<std::vector<float>>& planes,
                     IdSums* ids) {
  if (absl::Status status = ReadNames(names_text, &ids->names); !status.ok()) return status;
  if (planes.size() > kPlanesPerId * (kIdsPerPixelMax + 1)) {
    return absl::InvalidArgumentError(
        absl::StrCat("more than ", kIdsPerPixelMax, " ids in a pixel"));
  }
  for (size_t p = 0; p < ids->pixels.size(); ++p) {
    for (size_t k = 0; k < planes.size(); k += kPlanesPerId) {
      const float number = planes[k][p];
      if (number == 0) continue;
      IdList& list = ids->pixels[p];
      const bool fits = number >= 1 && number <= static_cast<float>(kIdMax + 1) &&
                        number == std::floor(number) && std::isfinite(planes[k + 1][p]) &&
                        std::isfinite(planes[k + 2][p]) && list.size() == k / kPlanesPerId;
      if (!fits) return absl::InvalidArgumentError("its ids do not form a list");
      const uint32_t id = static_cast<uint32_t>(number) - 1;
      if ((!list.empty() && list.back().id >= id) || (id != kNoId && !ids->names.contains(id))) {
        return absl::InvalidArgumentError("its ids are not in their order, or have no names");
      }
      const double weight = DoubleFloat{planes[k + 1][p], planes[k + 2][p]}.Value();
      list.push_back({id, DoubleFloat::Round(weight)});
    }
  }
  return absl::OkStatus();
}

}  // namespace sheaf
