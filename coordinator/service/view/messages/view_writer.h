// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// WriteView: the fields of a view into its message.
#pragma once

#include <google/protobuf/message.h>

#include <optional>
#include <string>
#include <type_traits>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/content/blob_digest.h"
#include "common/rpc/settings_codec.h"
#include "coordinator/service/view/messages/field_paths.h"
#include "coordinator/service/view/messages/view_messages.h"

namespace sheaf::coordinator {

template <typename View>
void WriteView(const View& view, google::protobuf::Message* message);

// Writes a member into one field of a message.
class FieldWriter {
 public:
  FieldWriter(const ViewField& described, const google::protobuf::FieldDescriptor* field,
              google::protobuf::Message* message)
      : described_(described),
        field_(field),
        message_(*message),
        reflection_(*message->GetReflection()) {}

  void Write(bool value) const { reflection_.SetBool(&message_, field_, value); }
  void Write(int32_t value) const { reflection_.SetInt32(&message_, field_, value); }
  void Write(uint32_t value) const { reflection_.SetUInt32(&message_, field_, value); }
  void Write(int64_t value) const { reflection_.SetInt64(&message_, field_, value); }
  void Write(uint64_t value) const { reflection_.SetUInt64(&message_, field_, value); }
  // A number, or the seconds of a duration.
  void Write(double value) const {
    if (field_->message_type() == nullptr) {
      reflection_.SetDouble(&message_, field_, value);
    } else {
      SetDuration(absl::Seconds(value), Inner<google::protobuf::Duration>());
    }
  }
  void Write(const std::string& value) const {
    if (value.empty() && described_.null_if_empty) return;
    reflection_.SetString(&message_, field_, absl::StrCat(described_.prefix, value));
  }
  void Write(absl::Time value) const {
    if (value != absl::InfiniteFuture()) SetTime(value, Inner<google::protobuf::Timestamp>());
  }
  void Write(absl::Duration value) const {
    if (value != absl::InfiniteDuration()) SetDuration(value, Inner<google::protobuf::Duration>());
  }
  void Write(const BlobDigest& value) const {
    if (value.sha256_hex.empty()) return;
    auto& digest = *Inner<v1::Digest>();
    digest.set_sha256_hex(value.sha256_hex);
    digest.set_size_bytes(value.size_bytes);
  }
  void Write(const FrameSettings& value) const {
    *Inner<v1::FrameSettings>() = sheaf::ToWire(value);
  }
  void Write(const std::vector<std::string>& values) const {
    for (const std::string& value : values) reflection_.AddString(&message_, field_, value);
  }
  template <typename T>
  void Write(const std::optional<T>& value) const {
    if (value) Write(*value);
  }
  template <typename Enum>
  requires std::is_enum_v<Enum>
  void Write(Enum value) const {
    reflection_.SetEnumValue(&message_, field_, static_cast<int>(value));
  }
  template <HasFields View>
  void Write(const View& view) const {
    google::protobuf::Message* const inner = reflection_.MutableMessage(&message_, field_);
    WriteView(view, inner);
    if (inner->ByteSizeLong() == 0) reflection_.ClearField(&message_, field_);
  }
  template <HasFields View>
  void Write(const std::vector<View>& views) const {
    for (const View& view : views) WriteView(view, reflection_.AddMessage(&message_, field_));
  }

 private:
  template <typename Message>
  Message* Inner() const {
    return static_cast<Message*>(reflection_.MutableMessage(&message_, field_));
  }

  const ViewField& described_;
  const google::protobuf::FieldDescriptor* const field_;
  google::protobuf::Message& message_;
  const google::protobuf::Reflection& reflection_;
};

// Whether a message leaves the member out.
template <typename T>
bool IsAbsent(const T& /*value*/) {
  return false;
}
template <typename T>
bool IsAbsent(const std::optional<T>& value) {
  return !value;
}
inline bool IsAbsent(const BlobDigest& digest) { return digest.sha256_hex.empty(); }

template <typename View>
void WriteView(const View& view, google::protobuf::Message* message) {
  const std::vector<FieldPath>& paths = PathsOf<View>(*message->GetDescriptor());
  size_t next = 0;
  VisitFields(view, [&](const ViewField& field, const auto& member) {
    const FieldPath& path = paths[next++];
    if (path.empty() || IsAbsent(member)) return;
    google::protobuf::Message* holder = message;
    for (size_t i = 0; i + 1 < path.size(); ++i) {
      holder = holder->GetReflection()->MutableMessage(holder, path[i]);
    }
    FieldWriter(field, path.back(), holder).Write(member);
  });
}

}  // namespace sheaf::coordinator
