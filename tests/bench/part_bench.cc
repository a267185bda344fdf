// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// part_bench: the cost of a part apart from its samples: encoding, decoding and size, for whole
// tiles, some cells of a tile, and the sparse pixels of a pilot. Sums have constant weights, as for
// filters without negative lobes.
#include <cstdio>
#include <string>

#include "common/base/check.h"
#include "common/film/exr/exr_codec.h"
#include "common/film/film_test_samples.h"
#include "tests/bench/measures.h"

namespace sheaf {
namespace {

constexpr int kRepeats = 200;
constexpr PixelRect kTile{32, 32, 64, 64};
constexpr SampleBlock kBlock{16, 16};

FilmTile MakeTile(const PartHeader& header) {
  FilmTile tile(kTile, kBlock);
  PixelAccumulator accumulator(&tile);
  for (const PixelRect& rect : RectsOf(kTile, header.cells)) {
    for (int32_t y = rect.y0; y < rect.y1; ++y) {
      for (int32_t x = rect.x0; x < rect.x1; ++x) {
        const SampleBlock samples = header.lattice.SamplesOf(header.lattice.PartOf(x, y), kBlock);
        if (samples.count == 0) continue;
        accumulator.Begin(x, y);
        for (uint64_t n = samples.first; n < samples.End(); ++n) {
          FilmSample sample = MakeTestSample(x, y, n);
          sample.filter_weight = 1;
          accumulator.Add(n, sample);
        }
        accumulator.End();
      }
    }
  }
  return tile;
}

// Microseconds per call, the median of many.
template <typename Call>
double Time(const Call& call) {
  std::vector<double> times;
  for (int i = 0; i < kRepeats; ++i) {
    const double start = ThreadCpuSeconds();
    call();
    times.push_back(1e6 * (ThreadCpuSeconds() - start));
  }
  return MedianOf(std::move(times));
}

void Measure(const char* name, const PartHeader& header) {
  const FilmTile tile = MakeTile(header);
  const std::string bytes = EncodePart(tile, header);
  const double encoding = Time([&] { SHEAF_CHECK(EncodePart(tile, header).size() > 0); });
  const double decoding = Time([&] { SHEAF_CHECK(DecodePart(bytes).ok()); });
  std::printf("%-22s encoding %6.0f us, decoding %6.0f us, %4zu KiB\n", name, encoding, decoding,
              bytes.size() / 1024);
}

}  // namespace
}  // namespace sheaf

int main() {
  sheaf::Measure("whole tile", {});
  sheaf::Measure("9 of 16 cells, spread", {"", "", {}, {8, 0b1011'0110'0101'1001}});
  sheaf::Measure("4 of 16 cells, close", {"", "", {}, {8, 0b0000'0110'0110'0000}});
  sheaf::Measure("a pilot's pixels", {"", "", {8, 3}, {}});
  return 0;
}
