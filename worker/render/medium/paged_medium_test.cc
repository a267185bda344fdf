// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// A medium of a page file has the bounds and the events of the medium of the same grid in memory.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "common/base/file.h"
#include "common/volume/page_maker.h"
#include "common/volume/volume_file.h"
#include "common/volume/volume_pages.h"
#include "tests/support/temporary_path.h"
#include "tests/support/volume/volume_writers.h"
#include "worker/render/medium/heterogeneous_medium.h"
#include "worker/render/medium/majorant_grid.h"

namespace sheaf::render {
namespace {

using ::sheaf::testing::NvdbCodec;
using ::sheaf::testing::NvdbFile;
using ::sheaf::testing::TemporaryPath;
using ::sheaf::testing::Voxel;
using volume::VolumePages;

// A ball of smooth density with lumps on one side.
float Ball(const Voxel& v) {
  const float x = static_cast<float>(v[0]) / 36, y = static_cast<float>(v[1]) / 30,
              z = static_cast<float>(v[2]) / 33;
  const float smooth = 1 - (x * x + y * y + z * z);
  if (smooth <= 0) return 0;
  return v[0] > 0 ? smooth : smooth * static_cast<float>((v[0] * 7 + v[1] * 5 + v[2]) & 3);
}

class PagedMediumTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const std::string bytes =
        NvdbFile({{.lo = {-36, -30, -33}, .hi = {36, 30, 33}, .value = Ball}}, NvdbCodec::kNone);
    ASSERT_TRUE(WriteFileAtomically(volume_path_, bytes).ok());
    const auto made = MakePageFile("ball.nvdb", volume_path_, page_path_);
    ASSERT_TRUE(made.ok()) << made.status();
    image_bytes_ = made->image_bytes;
  }
  ~PagedMediumTest() override {
    ::unlink(volume_path_.c_str());
    ::unlink(page_path_.c_str());
  }
  VolumeGrid Image() const { return *ReadVolumeGrid("ball.nvdb", volume_path_, "density"); }
  VolumeGrid Paged(const std::shared_ptr<VolumePages>& pages) const {
    return *ReadVolumeGrid("ball.pages", page_path_, "density", {}, 1, pages);
  }
  const std::string volume_path_ = TemporaryPath("volume"), page_path_ = TemporaryPath("pages");
  uint64_t image_bytes_ = 0;
};

TEST_F(PagedMediumTest, HasTheBoundsOfTheImage) {
  const VolumeGrid image = Image();
  uint64_t cells = 0;
  for (const double extinction : {0.001, 0.2, 2.0, 50.0}) {
    const auto pages = std::make_shared<VolumePages>(image_bytes_ / 10);
    const VolumeGrid paged = Paged(pages);
    const MajorantGrid::Options options{.extinction_per_voxel = extinction, .thread_count = 2};
    const MajorantGrid of_image = MajorantGrid::Build(GridDensitySource(image, 1.5f), options);
    const MajorantGrid of_pages = MajorantGrid::Build(GridDensitySource(paged, 1.5f), options);
    EXPECT_TRUE(pages->status().ok());
    EXPECT_EQ(of_pages.cell_count(), of_image.cell_count());
    EXPECT_EQ(of_pages.bounds(), of_image.bounds());
    cells = of_image.cell_count();
    // Where no block is divided, no page is read.
    if (extinction < 0.1) {
      EXPECT_EQ(pages->counts().pages_read, 0u);
    } else if (extinction > 10) {
      EXPECT_GT(pages->counts().pages_read, 0u);
    }
    EventStream random({1, 2, 3, 4});
    for (int i = 0; i < 200; ++i) {
      const auto uniform = [&] { return 2 * random.Uniform() - 1; };
      const Vec3d o{50 * uniform(), 50 * uniform(), 50 * uniform()};
      const Vec3d d{uniform(), uniform(), uniform()};
      MajorantWalk walk_image(of_image, o, d, 0, 100), walk_pages(of_pages, o, d, 0, 100);
      MajorantSegment a, b;
      while (walk_image.Next(&a)) {
        ASSERT_TRUE(walk_pages.Next(&b));
        ASSERT_EQ(a.t1, b.t1);
        ASSERT_EQ(a.bounds, b.bounds);
      }
      ASSERT_FALSE(walk_pages.Next(&b));
    }
  }
  EXPECT_GT(cells, 1000u);
}

// Where rays from all around first collide, in order.
std::vector<float> Events(const HeterogeneousMedium& medium, uint32_t seed) {
  std::vector<float> events;
  EventStream random({seed, 2, 3, 4});
  for (int i = 0; i < 400; ++i) {
    const auto uniform = [&] { return 2 * random.Uniform() - 1; };
    const Vec3d o{60 * uniform(), 60 * uniform(), 60 * uniform()};
    TrackingTally tally;
    events.push_back(
        medium.Transmittance(o, Vec3d{0, 0, 0} - o, 2.0, Rgb{0.05f, 0.1f, 0.2f}, &random, &tally)
            .g);
  }
  return events;
}

TEST_F(PagedMediumTest, HasTheEventsOfTheImageInAnyMemory) {
  HeterogeneousMedium::Placement placement;
  placement.extinction_max = 0.2;
  const auto image = HeterogeneousMedium::FromGrid("m", Image(), placement);
  ASSERT_TRUE(image.ok()) << image.status();
  constexpr uint32_t kThreads = 3;
  std::vector<std::vector<float>> expected;
  for (uint32_t t = 0; t < kThreads; ++t) expected.push_back(Events(*image, t));
  for (const uint64_t budget : {image_bytes_ / 100, image_bytes_ / 10, 2 * image_bytes_}) {
    const auto pages = std::make_shared<VolumePages>(budget);
    const auto paged = HeterogeneousMedium::FromGrid("m", Paged(pages), placement);
    ASSERT_TRUE(paged.ok()) << paged.status();
    const uint64_t pages_read = pages->counts().pages_read;
    EXPECT_EQ(paged->MeanDensity(), image->MeanDensity());
    EXPECT_EQ(pages->counts().pages_read, pages_read);
    std::vector<std::vector<float>> events(kThreads);
    std::vector<std::thread> threads;
    for (uint32_t t = 0; t < kThreads; ++t) {
      threads.emplace_back([&, t] { events[t] = Events(*paged, t); });
    }
    for (std::thread& thread : threads) thread.join();
    EXPECT_EQ(events, expected) << budget;
    EXPECT_TRUE(pages->status().ok());
    EXPECT_GT(pages->counts().pages_read, 0u);
  }
}

}  // namespace
}  // namespace sheaf::render
