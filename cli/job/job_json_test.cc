// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/job/job_json.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "common/scene/settings/techniques.h"

namespace sheaf::cli {
namespace {

TEST(JobJsonTest, WritesAJobOnOneLine) {
  v1::Job job;
  job.set_name("jobs/7");
  job.set_title("two\nlines and \xff");
  job.set_state(v1::Job::STATE_RUNNING);
  job.mutable_create_time()->set_seconds(0);
  job.mutable_progress()->set_sample_count_total(100);
  v1::Frame* frame = job.add_frames();
  frame->mutable_spec()->set_frame_number(3);
  frame->mutable_spec()->mutable_settings()->set_sample_count(16);
  frame->mutable_spec()->mutable_settings()->set_similarity_after_count(8);
  frame->mutable_spec()->mutable_settings()->set_techniques(v1::TECHNIQUES_CAMERA_AND_LIGHT);
  v1::UnreliableLayer* layer = frame->add_unreliable_layers();
  layer->set_layer("caustic");
  layer->set_tile_count(5);
  const std::string text = JobJson(job);
  EXPECT_EQ(text.find('\n'), std::string::npos);
  const nlohmann::json json = nlohmann::json::parse(text);
  EXPECT_EQ(json["name"], "jobs/7");
  EXPECT_EQ(json["state"], "running");
  EXPECT_EQ(json["create_time"], "1970-01-01T00:00:00.000Z");
  EXPECT_TRUE(json["end_time"].is_null());
  EXPECT_TRUE(json["progress"]["relative_mse"].is_null());
  EXPECT_TRUE(json["progress"]["remaining_duration_seconds"].is_null());
  EXPECT_EQ(json["frames"][0]["frame_number"], 3);
  EXPECT_TRUE(json["frames"][0]["flip"].is_null());
  EXPECT_EQ(json["frames"][0]["unreliable_layers"][0]["layer"], "caustic");
  EXPECT_EQ(json["frames"][0]["unreliable_layers"][0]["tile_count"], 5);
  EXPECT_EQ(json["frames"][0]["sample_count"], 16);
  EXPECT_EQ(json["frames"][0]["similarity_after_count"], 8);
  EXPECT_EQ(json["frames"][0]["techniques"], "camera+light");
}

TEST(JobJsonTest, NamesEveryTechnique) {
  v1::Job job;
  v1::FrameSettings* settings = job.add_frames()->mutable_spec()->mutable_settings();
  for (const std::string& name : TechniquesNames()) {
    settings->set_techniques(static_cast<v1::Techniques>(TechniqueSet::Parse(name)->Number()));
    EXPECT_EQ(nlohmann::json::parse(JobJson(job))["frames"][0]["techniques"], name);
  }
}

TEST(JobJsonTest, NamesAllStates) {
  EXPECT_EQ(JobStateName(v1::Job::STATE_SUCCEEDED), "succeeded");
  EXPECT_EQ(JobStateName(v1::Job::STATE_CANCELLED), "cancelled");
  EXPECT_EQ(JobStateName(v1::Job::STATE_PAUSED), "paused");
  EXPECT_EQ(WorkerStateName(v1::Worker::STATE_QUARANTINED), "quarantined");
  EXPECT_EQ(JobStateName(static_cast<v1::Job::State>(77)), "77");
  EXPECT_EQ(WorkerStateName(static_cast<v1::Worker::State>(77)), "77");
}

}  // namespace
}  // namespace sheaf::cli
