// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// For tests: a coordinator's messages for a task of a tiny scene, and their bundle.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "cli/bundle/bundle_file.h"
#include "common/base/check.h"
#include "common/base/file.h"
#include "common/content/chunk_codec.h"
#include "common/rpc/manifest_codec.h"
#include "common/rpc/settings_codec.h"

namespace sheaf::cli {

inline constexpr char kTinyScene[] = R"(LookAt 0 0 -3  0 0 0  0 1 0
Camera "perspective" "float fov" 45
Film "rgb" "integer xresolution" 4 "integer yresolution" 4
WorldBegin
LightSource "infinite" "rgb L" [0.5 0.6 0.7]
Material "diffuse" "rgb reflectance" [0.2 0.4 0.8]
Shape "sphere"
)";

struct MadeUpBundle {
  v1::TaskBundle task;
  std::vector<std::string> files;  // The manifest and the scene.

  explicit MadeUpBundle(const std::string& scene = kTinyScene) {
    const BlobDigest file{Sha256Hex(scene), scene.size()};
    files = {EncodeManifest(MakeManifest("scene.pbrt", {{"scene.pbrt", file}})), scene};
    FrameSettings settings;
    settings.width_px = settings.height_px = 4;
    settings.window = {0, 0, 4, 4};
    settings.samples = 4;
    task.set_format(kBundleFormat);
    task.set_frame_name("jobs/7/frames/1");
    task.mutable_scene()->set_sha256_hex(Sha256Hex(files[0]));
    task.mutable_scene()->set_size_bytes(files[0].size());
    *task.mutable_settings() = ToWire(settings);
    *task.mutable_key()->mutable_tile() = ToWire(settings.window);
    task.mutable_key()->mutable_block()->set_count(4);
    task.mutable_key()->set_frame_digest(
        FrameDigest(task.scene().sha256_hex(), settings, NumericProfile()));
    task.set_numeric_profile(NumericProfile());
  }
  void AddFailure(const std::string& kind, const std::string& message) {
    v1::RecordedFailure& failure = *task.add_failures();
    failure.set_kind(kind);
    failure.set_worker("node-7");
    failure.set_count(1);
    failure.set_message(message);
  }
  std::vector<v1::ReadTaskBundleResponse> Messages() const {
    std::vector<v1::ReadTaskBundleResponse> messages(1);
    *messages[0].mutable_bundle() = task;
    for (const std::string& file : files) {
      v1::ReadTaskBundleResponse message;
      message.mutable_file()->set_sha256_hex(Sha256Hex(file));
      message.mutable_file()->set_size_bytes(file.size());
      const size_t half = file.size() / 2;
      message.set_zstd_chunk(CompressChunk(file.substr(0, half)));
      messages.push_back(message);
      message.clear_file();
      message.set_zstd_chunk(CompressChunk(file.substr(half)));
      messages.push_back(message);
    }
    return messages;
  }
  absl::Status WriteTo(const std::string& path) const {
    BundleWriter writer(path, "9.9");
    for (const v1::ReadTaskBundleResponse& message : Messages()) {
      if (absl::Status status = writer.Take(message); !status.ok()) return status;
    }
    return writer.Finish();
  }
};

inline absl::StatusOr<Bundle> OpenBytes(const std::string& bytes) {
  return Bundle::Open(
      [bytes](uint64_t offset, uint64_t size) -> absl::StatusOr<std::string> {
        SHEAF_CHECK(offset + size <= bytes.size());
        return bytes.substr(offset, size);
      },
      bytes.size());
}

}  // namespace sheaf::cli
