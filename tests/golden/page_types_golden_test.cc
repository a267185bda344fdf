// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// dashboard/src/views.ts, the types of the HTTP port's JSON, follows from the descriptions of
// views.
#include <optional>
#include <set>
#include <string>
#include <type_traits>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/scene/settings/frame_settings_fields.h"
#include "coordinator/service/view/enum_name.h"
#include "coordinator/service/view/farm_view.h"
#include "gtest/gtest.h"
#include "tests/golden/golden_file.h"

namespace sheaf::coordinator {
namespace {

constexpr char kHead[] = R"(// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The objects of the coordinator's HTTP API; docs/reference/grpc.md describes their fields. Made by
// build/release/bin/sheaf_golden_test --renew from coordinator/service/view: do not edit it.
)";

// 'queued'|'running'|...: all values of this version.
template <typename Enum>
std::string EnumType() {
  constexpr int kFirst = std::is_same_v<Enum, JobState> || std::is_same_v<Enum, WorkerState>;
  std::string type;
  for (int i = kFirst; IsKnown(static_cast<Enum>(i)); ++i) {
    const std::string name = EnumName(static_cast<Enum>(i));
    // TaskKindName has a name for every number.
    if (std::is_same_v<Enum, TaskKind> && i > static_cast<int>(TaskKind::kTraining)) break;
    absl::StrAppend(&type, type.empty() ? "" : "|", "'", name, "'");
  }
  return type;
}

template <typename T>
struct IsVector : std::false_type {};
template <typename T>
struct IsVector<std::vector<T>> : std::true_type {};
template <typename T>
struct IsOptional : std::false_type {};
template <typename T>
struct IsOptional<std::optional<T>> : std::true_type {};

// Writes types, and before each those that it consists of.
class TypeWriter {
 public:
  // Adds the interface of a view. head: lines before its fields.
  template <typename View>
  void Add(const std::string& head = "") {
    const View view{};
    if (!known_.insert(ViewName(view)).second) return;
    std::string text = absl::StrCat("\nexport interface ", ViewName(view), " {\n", head);
    VisitFields(view, [&]<typename Member>(const ViewField& field, const Member& /*member*/) {
      using enum ViewField::Shown;
      if (field.shown == kOnlyMessages || field.shown == kNotHttp) return;
      if constexpr (std::is_same_v<Member, FrameSettings>) {
        absl::StrAppend(&text, SettingLines(field.settings));
      } else {
        absl::StrAppend(&text, "  ", field.name, ": ", TypeOf<Member>(),
                        field.null_if_empty ? "|null" : "", ";\n");
      }
    });
    absl::StrAppend(&text_, text, "}\n");
  }
  const std::string& text() const { return text_; }

 private:
  template <typename T>
  std::string TypeOf() {
    if constexpr (std::is_same_v<T, bool>) {
      return "boolean";
    } else if constexpr (std::is_arithmetic_v<T>) {
      return "number";
    } else if constexpr (std::is_same_v<T, std::string> || std::is_same_v<T, absl::Time>) {
      return "string";
    } else if constexpr (std::is_same_v<T, absl::Duration>) {
      return "number|null";
    } else if constexpr (std::is_same_v<T, BlobDigest>) {
      return "string|null";
    } else if constexpr (std::is_enum_v<T>) {
      return EnumType<T>();
    } else if constexpr (IsVector<T>::value) {
      return absl::StrCat(TypeOf<typename T::value_type>(), "[]");
    } else if constexpr (IsOptional<T>::value) {
      return absl::StrCat(TypeOf<typename T::value_type>(),
                          std::is_enum_v<typename T::value_type> ? "|''" : "|null");
    } else {
      Add<T>();
      return ViewName(T{});
    }
  }

  std::string SettingLines(SettingField::Shown shown) {
    std::string lines;
    const FrameSettings any;
    VisitFrameSettings(any, [&]<typename T>(const SettingField& field, const T&) {
      if (field.shown != shown) return;
      std::string type = "string";
      if constexpr (std::is_same_v<T, bool> || std::is_arithmetic_v<T> ||
                    std::is_same_v<T, PixelRect>) {
        type = TypeOf<T>();
      } else if constexpr (std::is_same_v<T, PixelLattice>) {
        type = "number";
      }
      absl::StrAppend(&lines, "  ", field.name, ": ", type, ";\n");
    });
    return lines;
  }

  std::set<std::string> known_;
  std::string text_ = kHead;
};

TEST(PageTypesGoldenTest, TypesOfThePageFollowFromViews) {
  TypeWriter types;
  types.Add<JobView>();
  types.Add<FrameView>("  name: string;\n");
  types.Add<EffectCost>();
  types.Add<FailureView>("  frame_name: string;\n");
  types.Add<JobEvent>();
  types.Add<WorkerView>();
  types.Add<RefinementPrices>();
  types.Add<RemovalView>();
  sheaf::testing::ExpectGoldenAt("dashboard/src/views.ts", types.text());
}

}  // namespace
}  // namespace sheaf::coordinator
