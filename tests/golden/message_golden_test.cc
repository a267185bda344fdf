// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Golden files of messages: their fields and methods, those made of views, and the JSON of the
// command line, which is made of the messages.
#include <google/protobuf/descriptor.h>
#include <google/protobuf/text_format.h>

#include <nlohmann/json.hpp>
#include <string>

#include "absl/strings/str_cat.h"
#include "cli/job/job_json.h"
#include "coordinator/service/grpc/wire.h"
#include "gtest/gtest.h"
#include "sheaf/v1/access.pb.h"
#include "sheaf/v1/bundle.pb.h"
#include "sheaf/v1/transfer.pb.h"
#include "tests/golden/golden_file.h"
#include "tests/golden/made_up_views.h"

namespace sheaf::coordinator {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::EnumDescriptor;
using google::protobuf::FieldDescriptor;
using google::protobuf::FileDescriptor;
using sheaf::testing::ExpectGolden;

std::string TypeOf(const FieldDescriptor& field) {
  const char* const prefix = field.is_repeated()    ? "repeated "
                             : field.has_presence() ? "optional "
                                                    : "";
  if (field.message_type() != nullptr)
    return absl::StrCat(prefix, field.message_type()->full_name());
  if (field.enum_type() != nullptr) return absl::StrCat(prefix, field.enum_type()->full_name());
  return absl::StrCat(prefix, field.type_name());
}

void Describe(const EnumDescriptor& values, std::string* text) {
  for (int i = 0; i < values.value_count(); ++i) {
    absl::StrAppend(text, values.full_name(), ".", values.value(i)->name(), " = ",
                    values.value(i)->number(), "\n");
  }
}

void Describe(const Descriptor& message, std::string* text) {
  for (int i = 0; i < message.field_count(); ++i) {
    const FieldDescriptor& field = *message.field(i);
    absl::StrAppend(text, field.full_name(), " = ", field.number(), ": ", TypeOf(field), "\n");
  }
  for (int i = 0; i < message.enum_type_count(); ++i) Describe(*message.enum_type(i), text);
  for (int i = 0; i < message.nested_type_count(); ++i) Describe(*message.nested_type(i), text);
}

void Describe(const FileDescriptor& file, std::string* text) {
  for (int i = 0; i < file.service_count(); ++i) {
    for (int k = 0; k < file.service(i)->method_count(); ++k) {
      const google::protobuf::MethodDescriptor& method = *file.service(i)->method(k);
      absl::StrAppend(text, method.full_name(), ": ", method.client_streaming() ? "stream " : "",
                      method.input_type()->full_name(), " to ",
                      method.server_streaming() ? "stream " : "", method.output_type()->full_name(),
                      "\n");
    }
  }
  for (int i = 0; i < file.message_type_count(); ++i) Describe(*file.message_type(i), text);
  for (int i = 0; i < file.enum_type_count(); ++i) Describe(*file.enum_type(i), text);
}

std::string Text(const google::protobuf::Message& message) {
  std::string text;
  google::protobuf::TextFormat::PrintToString(message, &text);
  return absl::StrCat(message.GetDescriptor()->name(), "\n", text, "\n");
}

JobView UnknownJob() {
  JobView job;
  job.job_id = "4";
  return job;
}

TEST(MessageGoldenTest, ProtosAreUnchanged) {
  std::string text;
  for (const Descriptor* const first :
       {v1::CreateJobRequest::descriptor(), v1::Job::descriptor(), v1::Worker::descriptor(),
        v1::SynchronizeRequest::descriptor(), v1::Frame::descriptor(), v1::Digest::descriptor(),
        v1::TaskBundle::descriptor(), v1::PlanWriteResponse::descriptor(),
        v1::EnrollRequest::descriptor()}) {
    Describe(*first->file(), &text);
  }
  ExpectGolden("protos.txt", text);
}

TEST(MessageGoldenTest, MessagesOfViewsAreUnchanged) {
  std::string text = Text(ToWire(MadeUpJob()));
  absl::StrAppend(&text, Text(ToWire(UnknownJob())), Text(ToWire(MadeUpWorker())),
                  Text(ToWire(WorkerView())), Text(ToWire(MadeUpPrices())));
  for (const ShareView& share : MadeUpShares()) absl::StrAppend(&text, Text(ToWire(share)));
  ExpectGolden("messages.txt", text);
}

// Objects of JSON have no order: the files have the fields by name.
TEST(MessageGoldenTest, JsonOfCommandsIsUnchanged) {
  // As a later version may send it.
  JobView unknown = UnknownJob();
  unknown.frames.resize(1);
  v1::Job later = ToWire(unknown);
  later.set_state(static_cast<v1::Job::State>(77));
  v1::Frame& frame = *later.mutable_frames(0);
  frame.mutable_spec()->mutable_settings()->set_techniques(static_cast<v1::Techniques>(999));
  frame.set_complete(true);
  frame.set_stop_reason(static_cast<v1::StopReason>(77));
  v1::Worker later_worker = ToWire(WorkerView());
  later_worker.set_state(static_cast<v1::Worker::State>(77));
  RefinementPrices without_workers = MadeUpPrices();
  without_workers.thread_count = 0;
  without_workers.prices[0].wall_seconds.reset();
  std::string text;
  for (const std::string& json :
       {cli::JobJson(ToWire(MadeUpJob())), cli::JobJson(ToWire(UnknownJob())), cli::JobJson(later),
        cli::WorkerJson(ToWire(MadeUpWorker())), cli::WorkerJson(ToWire(WorkerView())),
        cli::WorkerJson(later_worker), cli::ShareJson(ToWire(MadeUpShares()[0])),
        cli::ShareJson(ToWire(MadeUpShares()[1])),
        cli::RefinementPricesJson(ToWire(MadeUpPrices())),
        cli::RefinementPricesJson(ToWire(without_workers))}) {
    EXPECT_EQ(json.find('\n'), std::string::npos);
    absl::StrAppend(&text, nlohmann::json::parse(json).dump(1), "\n\n");
  }
  ExpectGolden("command_json.txt", text);
}

}  // namespace
}  // namespace sheaf::coordinator
