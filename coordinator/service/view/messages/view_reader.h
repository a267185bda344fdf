// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ReadView: the fields of a view from its message.
#pragma once

#include <google/protobuf/message.h>

#include <optional>
#include <string>
#include <type_traits>
#include <vector>

#include "absl/strings/strip.h"
#include "common/content/blob_digest.h"
#include "common/rpc/settings_codec.h"
#include "coordinator/service/view/messages/field_paths.h"

namespace sheaf::coordinator {

template <typename View>
void ReadView(const google::protobuf::Message& message, View* view);

// Reads a member from one field of a message.
class FieldReader {
 public:
  FieldReader(const ViewField& described, const google::protobuf::FieldDescriptor* field,
              const google::protobuf::Message& message)
      : described_(described),
        field_(field),
        message_(message),
        reflection_(*message.GetReflection()) {}

  void Read(bool& value) const { value = reflection_.GetBool(message_, field_); }
  void Read(int32_t& value) const { value = reflection_.GetInt32(message_, field_); }
  void Read(uint32_t& value) const { value = reflection_.GetUInt32(message_, field_); }
  void Read(int64_t& value) const { value = reflection_.GetInt64(message_, field_); }
  void Read(uint64_t& value) const { value = reflection_.GetUInt64(message_, field_); }
  void Read(double& value) const {
    if (field_->message_type() == nullptr) {
      value = reflection_.GetDouble(message_, field_);
      return;
    }
    const auto& duration = Inner<google::protobuf::Duration>();
    value = static_cast<double>(duration.seconds()) + duration.nanos() * 1e-9;
  }
  void Read(std::string& value) const {
    value =
        std::string(absl::StripPrefix(reflection_.GetString(message_, field_), described_.prefix));
  }
  void Read(absl::Time& value) const {
    if (!reflection_.HasField(message_, field_)) {
      value = absl::InfiniteFuture();
      return;
    }
    const auto& time = Inner<google::protobuf::Timestamp>();
    value = absl::FromUnixSeconds(time.seconds()) + absl::Nanoseconds(time.nanos());
  }
  void Read(absl::Duration& value) const {
    if (!reflection_.HasField(message_, field_)) {
      value = absl::InfiniteDuration();
      return;
    }
    const auto& duration = Inner<google::protobuf::Duration>();
    value = absl::Seconds(duration.seconds()) + absl::Nanoseconds(duration.nanos());
  }
  void Read(BlobDigest& value) const {
    const auto& digest = Inner<v1::Digest>();
    value = {digest.sha256_hex(), digest.size_bytes()};
  }
  void Read(FrameSettings& value) const { value = ReadUnchecked(Inner<v1::FrameSettings>()); }
  void Read(std::vector<std::string>& values) const {
    for (int i = 0; i < reflection_.FieldSize(message_, field_); ++i) {
      values.push_back(reflection_.GetRepeatedString(message_, field_, i));
    }
  }
  // Fields of numbers have no presence: 0 stands for none.
  template <typename T>
  void Read(std::optional<T>& value) const {
    T read{};
    const bool present = reflection_.HasField(message_, field_);
    Read(read);
    if (present) value = read;
  }
  template <typename Enum>
  requires std::is_enum_v<Enum>
  void Read(Enum& value) const {
    value = static_cast<Enum>(reflection_.GetEnumValue(message_, field_));
  }
  template <HasFields View>
  void Read(View& view) const {
    ReadView(reflection_.GetMessage(message_, field_), &view);
  }
  template <HasFields View>
  void Read(std::vector<View>& views) const {
    for (int i = 0; i < reflection_.FieldSize(message_, field_); ++i) {
      ReadView(reflection_.GetRepeatedMessage(message_, field_, i), &views.emplace_back());
    }
  }

 private:
  template <typename Message>
  const Message& Inner() const {
    return static_cast<const Message&>(reflection_.GetMessage(message_, field_));
  }

  const ViewField& described_;
  const google::protobuf::FieldDescriptor* const field_;
  const google::protobuf::Message& message_;
  const google::protobuf::Reflection& reflection_;
};

template <typename View>
void ReadView(const google::protobuf::Message& message, View* view) {
  const std::vector<FieldPath>& paths = PathsOf<View>(*message.GetDescriptor());
  size_t next = 0;
  // Computed values are shown by HTTP alone.
  VisitFields(*view, [&]<typename Member>(const ViewField& field, Member&& member) {
    const FieldPath& path = paths[next++];
    if constexpr (std::is_lvalue_reference_v<Member>) {
      if (path.empty()) return;
      const google::protobuf::Message* holder = &message;
      for (size_t i = 0; i + 1 < path.size(); ++i) {
        holder = &holder->GetReflection()->GetMessage(*holder, path[i]);
      }
      FieldReader(field, path.back(), *holder).Read(member);
    }
  });
}

}  // namespace sheaf::coordinator
