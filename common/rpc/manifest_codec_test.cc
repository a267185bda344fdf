// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/rpc/manifest_codec.h"

#include <gtest/gtest.h>

#include <limits>

namespace sheaf {
namespace {

const std::string kHex(64, 'a');

TEST(ManifestCodecTest, RoundTrips) {
  const Manifest manifest =
      MakeManifest("room.pbrt", {{"room.pbrt", {kHex, 12}}, {"models/a.ply", {kHex, 1u << 31}}});
  const absl::StatusOr<Manifest> back = DecodeManifest(EncodeManifest(manifest));
  ASSERT_TRUE(back.ok()) << back.status();
  EXPECT_EQ(*back, manifest);
}

TEST(ManifestCodecTest, MatricesOfTheCameraRoundTrip) {
  Manifest manifest = MakeManifest("a", {{"a", {kHex, 1}}});
  manifest.world_to_camera.assign(16, 0.1f);
  const absl::StatusOr<Manifest> back = DecodeManifest(EncodeManifest(manifest));
  ASSERT_TRUE(back.ok()) << back.status();
  EXPECT_EQ(*back, manifest);
  manifest.world_to_ndc.assign(15, 1);
  EXPECT_FALSE(CheckManifest(manifest).ok());
  manifest.world_to_ndc.assign(16, std::numeric_limits<float>::infinity());
  EXPECT_FALSE(CheckManifest(manifest).ok());
}

TEST(ManifestCodecTest, EqualScenesHaveEqualBytes) {
  const Manifest one = MakeManifest("a", {{"a", {kHex, 1}}, {"b", {kHex, 2}}});
  const Manifest two = MakeManifest("a", {{"b", {kHex, 2}}, {"a", {kHex, 1}}});
  EXPECT_EQ(EncodeManifest(one), EncodeManifest(two));
}

TEST(ManifestCodecTest, FilesOnDemandAreTold) {
  const Manifest manifest = MakeManifest("a", {{"a", {kHex, 1}}, {"b", {kHex, 2}, true}});
  const auto back = DecodeManifest(EncodeManifest(manifest));
  ASSERT_TRUE(back.ok()) << back.status();
  EXPECT_EQ(*back, manifest);
  Manifest at_once = manifest;
  at_once.files[1].is_on_demand = false;
  EXPECT_GT(EncodeManifest(manifest).size(), EncodeManifest(at_once).size());
}

TEST(ManifestCodecTest, RefusesInvalidBytes) {
  EXPECT_FALSE(DecodeManifest("").ok());
  EXPECT_FALSE(DecodeManifest("Shape \"sphere\"").ok());
  const std::string bytes = EncodeManifest(MakeManifest("a", {{"a", {kHex, 1}}}));
  for (size_t size = 0; size < bytes.size(); ++size) {
    EXPECT_FALSE(DecodeManifest(bytes.substr(0, size)).ok()) << size;
  }
}

}  // namespace
}  // namespace sheaf
