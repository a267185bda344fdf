// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cmath>
#include <string>

#include "absl/status/statusor.h"
#include "tests/support/chi_square.h"
#include "tests/support/made_up_light.h"
#include "worker/render/guiding/guiding_field.h"

namespace sheaf::render {
namespace {

// Where the parts of a field of one region begin.
constexpr size_t kVersionAt = 4, kBoxAt = 8, kSpaceAt = 56, kLightAt = 57, kShareAt = 65,
                 kQuadsAt = 69;
constexpr size_t kNodeBytes = 17;

std::string Bytes(double v) {
  std::string out;
  for (size_t i = 0; i < 8; ++i) {
    out.push_back(static_cast<char>((std::bit_cast<uint64_t>(v) >> (8 * i)) & 0xff));
  }
  return out;
}
std::string Bytes(float v) {
  std::string out;
  for (size_t i = 0; i < 4; ++i) {
    out.push_back(static_cast<char>((std::bit_cast<uint32_t>(v) >> (8 * i)) & 0xff));
  }
  return out;
}
std::string EvenNode(int divided) {
  std::string out(1, static_cast<char>(divided));
  for (int q = 0; q < 4; ++q) out += Bytes(0.25f);
  return out;
}
// A tree over space with 2^depth regions; the first ones have the given bytes.
void AddTree(int depth, const std::string& region, int* count, std::string* out) {
  if (depth == 0) {
    *out += std::string(1, 0) + ((*count)-- > 0 ? region : Bytes(0.0));
    return;
  }
  out->push_back(1);
  AddTree(depth - 1, region, count, out);
  AddTree(depth - 1, region, count, out);
}

// A field of one region.
GuidingField Small() {
  GuidingField field = Train(SkyAndSource, 1, 400);
  EXPECT_EQ(field.region_count(), 1u);
  return field;
}

std::string ErrorOf(const std::string& bytes) {
  const absl::StatusOr<GuidingField> field = GuidingField::Decode(bytes);
  if (field.ok()) return "";
  EXPECT_EQ(field.status().code(), absl::StatusCode::kDataLoss);
  return std::string(field.status().message());
}
std::string Replaced(std::string bytes, size_t at, const std::string& by) {
  return bytes.replace(at, by.size(), by);
}

TEST(GuidingCodecTest, FieldsComeBack) {
  const GuidingField field = Train(SkyAndSource, 3, 10000);
  ASSERT_GT(field.region_count(), 8u);
  const std::string bytes = field.Encode();
  const absl::StatusOr<GuidingField> back = GuidingField::Decode(bytes);
  ASSERT_TRUE(back.ok()) << back.status();
  EXPECT_EQ(back->Encode(), bytes);
  EXPECT_EQ(back->region_count(), field.region_count());
  for (uint64_t i = 0; i < 2000; ++i) {
    const Vec3f p = FindLight(SkyAndSource, i).p;
    const GuidingRegion *a = field.RegionAt({p}), *b = back->RegionAt({p});
    ASSERT_NE(a, nullptr);
    ASSERT_NE(b, nullptr);
    const std::array<float, 3> u = sheaf::testing::CounterUniforms(5, i);
    const Vec3f w = a->Sample({u[0], u[1]});
    ASSERT_EQ(b->Sample({u[0], u[1]}), w);
    ASSERT_EQ(b->Pdf(w), a->Pdf(w));
    ASSERT_EQ(b->ScatteredLight(), a->ScatteredLight());
    ASSERT_EQ(b->share(), a->share());
  }
}

TEST(GuidingCodecTest, RegionsThatLearnedNothingComeBack) {
  const std::string bytes = GuidingField(BoxOf()).Encode();
  EXPECT_EQ(bytes.size(), kShareAt);
  const absl::StatusOr<GuidingField> back = GuidingField::Decode(bytes);
  ASSERT_TRUE(back.ok()) << back.status();
  EXPECT_EQ(back->RegionAt({0, 0, 0}), nullptr);
  EXPECT_EQ(back->Encode(), bytes);
}

// Damaged bytes are refused, or are those of another field that works.
TEST(GuidingCodecTest, DamageIsRefusedOrHarmless) {
  const std::string bytes = Small().Encode();
  ASSERT_LT(bytes.size(), 5000u);
  for (size_t length = 0; length < bytes.size(); ++length) {
    ASSERT_NE(ErrorOf(bytes.substr(0, length)), "") << length;
  }
  int refused = 0;
  for (size_t at = 0; at < bytes.size(); ++at) {
    for (const int flip : {0x01, 0x10, 0x80, 0xff}) {
      std::string damaged = bytes;
      damaged[at] = static_cast<char>(damaged[at] ^ flip);
      const absl::StatusOr<GuidingField> field = GuidingField::Decode(damaged);
      if (!field.ok()) {
        ++refused;
        continue;
      }
      ASSERT_EQ(field->Encode(), damaged);
      const GuidingRegion* region = field->RegionAt({0.1f, 0.2f, 0.3f});
      ASSERT_NE(region, nullptr);
      ASSERT_TRUE(std::isfinite(region->ScatteredLight()));
      for (uint64_t i = 0; i < 20; ++i) {
        const std::array<float, 3> u = sheaf::testing::CounterUniforms(at, i);
        const Vec3f w = region->Sample({u[0], u[1]});
        ASSERT_NEAR(LengthSquared(w), 1, 1e-6f);
        ASSERT_TRUE(region->Pdf(w) > 0 && std::isfinite(region->Pdf(w))) << at;
      }
    }
  }
  EXPECT_GT(refused, static_cast<int>(bytes.size()));
}

TEST(GuidingCodecTest, EachKindOfDamageHasItsReason) {
  const std::string bytes = Small().Encode();
  const std::string head = bytes.substr(0, kSpaceAt);
  EXPECT_EQ(ErrorOf(bytes), "");
  const struct {
    std::string bytes, reason;
  } cases[] = {
      {Replaced(bytes, 0, "X"), "does not begin as one"},
      {Replaced(bytes, kVersionAt, "\1"), "has the unknown version 1"},
      {Replaced(bytes, kBoxAt, Bytes(2.0)), "has an impossible box"},
      {Replaced(bytes, kBoxAt + 24, Bytes(std::nan(""))), "has an impossible box"},
      {Replaced(bytes, kBoxAt + 24, Bytes(1e300)), "has an impossible box"},
      {Replaced(bytes, kSpaceAt, "\2"), "has a damaged tree of regions"},
      {Replaced(bytes, kLightAt, Bytes(-1.0)), "has light that is negative or not finite"},
      {Replaced(bytes, kLightAt, Bytes(-0.0)), "has light that is negative or not finite"},
      {Replaced(bytes, kLightAt, Bytes(HUGE_VAL)), "has light that is negative or not finite"},
      {Replaced(bytes, kLightAt, Bytes(0.0)), "has bytes after its end"},
      {Replaced(bytes, kShareAt, Bytes(0.95f)), "has an impossible share of directions"},
      {Replaced(bytes, kShareAt, Bytes(std::nanf(""))), "has an impossible share of directions"},
      {Replaced(bytes, kQuadsAt, "\x1f"), "has a damaged tree of directions"},
      {Replaced(bytes, kQuadsAt + 1, Bytes(0.0f)), "has a direction without density"},
      {Replaced(bytes, kQuadsAt + 1, Bytes(std::nanf(""))), "has a direction without density"},
      {Replaced(bytes, kQuadsAt + 1, Bytes(0.9f)), "has fractions that do not sum to 1"},
      {bytes.substr(0, kQuadsAt + kNodeBytes + 3), "ends too early"},
      {bytes + '\0', "has bytes after its end"},
      {head + std::string(49, 1), "has a tree of regions that is too deep"},
      {std::string(kGuidingDirectionsBytesMax + 1, 0), "is larger than any"},
  };
  for (const auto& c : cases) {
    EXPECT_NE(ErrorOf(c.bytes).find("the guiding field " + c.reason), std::string::npos)
        << c.reason << ": " << ErrorOf(c.bytes);
  }
}

TEST(GuidingCodecTest, LimitsAreChecked) {
  const std::string head = GuidingField(BoxOf()).Encode().substr(0, kSpaceAt);
  const auto field = [&](int depth, const std::string& region, int count) {
    std::string bytes = head;
    AddTree(depth, region, &count, &bytes);
    return bytes;
  };
  EXPECT_EQ(ErrorOf(field(13, "", 0)), "");
  EXPECT_NE(ErrorOf(field(14, "", 0)).find("too many regions"), std::string::npos);
  // 256 even quads: 85 nodes, and 84 quads in a region that has learned nothing.
  std::string region = Bytes(1.0) + Bytes(0.5f);
  for (int i = 0; i < 85; ++i) region += EvenNode(i < 21 ? 0xf : 0);
  EXPECT_EQ(ErrorOf(field(13, region, 1400)), "");
  EXPECT_NE(ErrorOf(field(13, region, 2000)).find("too many directions"), std::string::npos);
  // One quad that is divided ten times, and one more time.
  std::string deep = Bytes(1.0) + Bytes(0.5f), deeper = deep;
  for (int i = 0; i < kGuidingQuadDepthMax; ++i) {
    const bool is_last = i + 1 == kGuidingQuadDepthMax;
    deep += EvenNode(is_last ? 0 : 1);
    deeper += EvenNode(1);
  }
  deeper += EvenNode(0);
  EXPECT_EQ(ErrorOf(field(0, deep, 1)), "");
  EXPECT_NE(ErrorOf(field(0, deeper, 1)).find("tree of directions that is too large"),
            std::string::npos);
  // All quads are divided, until there are more nodes than a region can have.
  std::string wide = Bytes(1.0) + Bytes(0.5f);
  for (int i = 0; i < 2000; ++i) wide += EvenNode(0xf);
  EXPECT_NE(ErrorOf(field(0, wide, 1)).find("tree of directions that is too large"),
            std::string::npos);
}

}  // namespace
}  // namespace sheaf::render
