// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests the bytes of emission fields. How rays follow a field:
// tests/render/guided_emission_test.cc.
#include "worker/render/guiding/emission_field.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <string>
#include <vector>

namespace sheaf::render {
namespace {

using ::testing::HasSubstr;

void AppendWord(uint32_t word, std::string* bytes) {
  for (int i = 0; i < 4; ++i) bytes->push_back(static_cast<char>(word >> 8 * i & 0xff));
}
std::string HeadOf(uint32_t light_count, uint32_t version = 1) {
  std::string bytes = "SHEF";
  AppendWord(version, &bytes);
  AppendWord(light_count, &bytes);
  return bytes;
}
std::string Divided(char kind, uint32_t light, float lower_share) {
  std::string bytes(1, kind);
  AppendWord(light, &bytes);
  AppendWord(std::bit_cast<uint32_t>(lower_share), &bytes);
  return bytes;
}
const std::string kCell(1, '\0');
constexpr char kByLight = 5, kAlongDirectionX = 3;

// Three lights: [0, 2) with a quarter, and the third, whose upper half of directions has two thirds
// of the rest.
std::string SmallField() {
  return HeadOf(3) + Divided(kByLight, 2, 0.25f) + kCell + Divided(kAlongDirectionX, 0, 1.0f / 3) +
         kCell + kCell;
}

TEST(EmissionFieldTest, KeepsItsBytes) {
  const auto field = EmissionField::Decode(SmallField(), 3);
  ASSERT_TRUE(field.ok()) << field.status();
  EXPECT_EQ(field->Encode(), SmallField());
  EXPECT_EQ(field->cell_count(), 3u);
  EXPECT_FALSE(field->empty());
  EXPECT_TRUE(EmissionField().empty());
}

TEST(EmissionFieldTest, CellsHaveTheirShareAndTheirBox) {
  const auto field = EmissionField::Decode(SmallField(), 3);
  ASSERT_TRUE(field.ok()) << field.status();
  const EmissionField::Cell two = field->CellOf(1, {{0.1, 0.9, 0.9, 0.5}});
  EXPECT_EQ(two.first, 0u);
  EXPECT_EQ(two.last, 2u);
  EXPECT_EQ(two.density, 0.25);
  const EmissionField::Cell upper = field->CellOf(2, {{0.1, 0.9, 0.5, 0.5}});
  EXPECT_EQ(upper.first, 2u);
  EXPECT_NEAR(upper.density, 0.75 * (2.0 / 3) * 2, 1e-7);
  EXPECT_NEAR(field->CellOf(2, {{0.1, 0.9, 0.49, 0.5}}).density, 0.75 / 3 * 2, 1e-7);
  // The choice, and what is left of the number that chose.
  double v = 0.125;
  EXPECT_EQ(field->Sample(&v).last, 2u);
  EXPECT_NEAR(v, 0.5, 1e-12);
  v = 0.25 + 0.75 * (1.0 / 3 + 0.25 * 2 / 3);
  const EmissionField::Cell drawn = field->Sample(&v);
  EXPECT_NEAR(v, 0.25, 1e-6);
  EXPECT_EQ(drawn.lower[2], 0.5);
  EXPECT_EQ(drawn.size[2], 0.5);
  EXPECT_EQ(drawn.size[0], 1);
  EXPECT_EQ(drawn.PlaceAt({{0.5, 0.5, 0.5, 0.25}}).u[2], 0.75);
  EXPECT_EQ(drawn.density, upper.density);
}

TEST(EmissionFieldTest, RefusesOtherBytes) {
  const std::string fine = SmallField();
  const auto expect_refused = [](const std::string& bytes, const char* reason,
                                 uint32_t light_count = 3) {
    const auto field = EmissionField::Decode(bytes, light_count);
    ASSERT_FALSE(field.ok()) << reason;
    EXPECT_EQ(field.status().code(), absl::StatusCode::kDataLoss);
    EXPECT_THAT(std::string(field.status().message()), HasSubstr(reason));
  };
  for (size_t size = 0; size < fine.size(); ++size) {
    EXPECT_FALSE(EmissionField::Decode(fine.substr(0, size), 3).ok()) << size;
  }
  expect_refused(fine + kCell, "followed by other bytes");
  expect_refused("SHCF" + fine.substr(4), "does not begin as one");
  expect_refused(HeadOf(3, 2) + kCell, "unknown version 2");
  expect_refused(fine, "other lights", 4);
  expect_refused(HeadOf(3) + "\x06" + std::string(8, '\0'), "impossible node");
  // A part without lights, and an axis of several lights.
  expect_refused(HeadOf(3) + Divided(kByLight, 0, 0.5f) + kCell + kCell, "impossible node");
  expect_refused(HeadOf(3) + Divided(kByLight, 3, 0.5f) + kCell + kCell, "impossible node");
  expect_refused(HeadOf(3) + Divided(kAlongDirectionX, 0, 0.5f) + kCell + kCell, "impossible node");
  for (const float share : {-0.25f, 1.25f, std::bit_cast<float>(0x7fc00000u)}) {
    expect_refused(HeadOf(3) + Divided(kByLight, 2, share) + kCell + kCell,
                   "impossible probability");
  }
  // Finer than the finest cells.
  std::string deep = HeadOf(1), ends;
  for (uint32_t i = 0; i <= kEmissionHalvingsMax; ++i) {
    deep += Divided(kAlongDirectionX, 0, 0.5f);
    ends += kCell;
  }
  expect_refused(deep + ends + kCell, "impossible node", 1);
}

}  // namespace
}  // namespace sheaf::render
