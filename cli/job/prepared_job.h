// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PreparedJob: turns scene files on this machine into what a submission needs: the settings and
// manifest of every frame, and the blobs that they refer to.
//
//     paths > ReadScene > ResolveSettings, manifest > digests > PreparedJob
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "cli/gltf/gltf_inputs.h"
#include "cli/image/view_transform.h"
#include "cli/job/farm_client.h"
#include "cli/job/format/image_format.h"
#include "cli/job/frames/frame_range.h"
#include "cli/job/paged_volumes.h"
#include "common/content/file_state.h"
#include "common/scene/film_size.h"
#include "common/scene/scene_description.h"
#include "common/scene/settings/render_settings.h"
#include "coordinator/core/job/job.h"

namespace sheaf::cli {

// The requested conditions under which frames stop; see v1::StopRule.
struct StopArguments {
  double target_error = 0;      // 0 in all three: no such condition.
  double seconds = 0;           // Wall time of a frame.
  double budget_cpu_hours = 0;  // For the job; divided equally among its frames.
  bool certified = false;       // The target is one of the certified error.

  bool IsActive() const { return target_error > 0 || seconds > 0 || budget_cpu_hours > 0; }
};
using coordinator::kStoppedSamplesMax;

// The detail of printed results. kAll adds what few users need: rates, FLIP, fireflies, and the
// gain of one sequence.
enum class Detail { kShort, kAll };

// The arguments that submit and render share.
struct JobArguments {
  // A path, or a pattern with #### if frames is given (frame_range.h); for a glTF file always a
  // path.
  std::string scene;
  std::string frames;        // As for ParseFrameRange; empty for a single image.
  std::string output;        // A path or pattern; empty: taken from the scene.
  std::string png;           // The same for a PNG; empty: no PNG.
  std::string png_layer;     // As for ImageOfLayer.
  ViewArguments view;        // The view that PNGs show.
  ImageFormat format;        // For EXRs.
  std::string denoise_with;  // A command, as for AddExternalLayer; empty: none.
  Detail detail = Detail::kShort;
  std::string title;  // Empty: the scene's file name.
  int32_t priority = 0;
  std::string show;  // Empty: the default one.
  std::string pool;  // The same.
  std::vector<std::string> required_tags;
  uint64_t memory_min_bytes = 0;
  FilmSize size;
  GltfArguments gltf;
  RenderSettings settings;
  // Without --techniques, frames with light paths would be refused: nothing is measured.
  bool keep_camera_paths = false;
  StopArguments stop;
  uint64_t paged_file_bytes_min = kPagedFileBytesMin;  // As for PagedVolumes.
  std::string resume_from;   // A delivered EXR that the frame continues from; empty: none.
  int32_t tile_size_px = 0;  // 0 in these four: the coordinator chooses.
  int32_t cell_size_px = 0;
  uint64_t pass_sample_count = 0;
  uint64_t lease_pass_count = 0;

  // Whether it renders two eyes.
  bool IsStereo() const { return settings.eye_distance > 0 || !gltf.right_camera.empty(); }
};

struct PreparedFrame {
  int32_t number = 1;
  BlobDigest manifest;
  FrameSettings settings;
  std::string film_filename;             // The scene's name for its image; may be empty.
  FilterDescription filter = {};         // The scene's.
  std::vector<PixelRect> emitters = {};  // As returned by VisibleEmitters.
  BlobDigest resumed = {};               // The EXR to continue from; empty: none.
  uint64_t memory_bytes = 0;             // Expected need of loading the scene.
};

struct PreparedJob {
  std::vector<PreparedFrame> frames;
  std::map<std::string, BlobSource> blobs;  // By digest.
  std::map<std::string, FileState> inputs;  // State when read; by path.
  std::set<std::string> outside;            // Files outside the scene's folder, for OutsideNote.
  bool is_photometric = false;              // A glTF file with lights in candela and lux.
  std::vector<std::string> diagnostics;     // Notes and warnings of the reader without duplicates.
  std::shared_ptr<DerivedFiles> derived;    // Keeps files among the blobs until they are uploaded.
  // The scene of a job with one frame, where it was asked for: as its reader returned it.
  std::optional<SceneDescription> description = {};
};

// Errors: kInvalidArgument if the names of the images do not match their formats; those of
// CheckImageFormat and CheckDenoiser.
absl::Status CheckImageNames(const JobArguments& arguments);
// Errors: kInvalidArgument if the arguments contradict each other: wrong usage, not a wrong scene.
absl::Status CheckJobArguments(const JobArguments& arguments);

// Reads all frames, several concurrently, and hashes every file once. Requires: CheckJobArguments
// is OK. Errors: kInvalidArgument (a scene has errors: all of them, one per line); kNotFound and
// kPermissionDenied for files; kFailedPrecondition for files that change meanwhile.
// keeps_description: whether the result has the description of a job's only scene, which takes as
// much memory again; not where --size changes it.
absl::StatusOr<PreparedJob> PrepareJob(const JobArguments& arguments,
                                       bool keeps_description = false);

// The paths of a frame's image.
struct ImagePaths {
  std::string exr;
  std::string png;  // Empty: no PNG.
};
// Which runs of '#' in the names of images are the frame's number.
enum class Numbering {
  kAsked,    // Frames were requested: any run of '#'.
  kUnasked,  // A single image was requested: none.
  kUnknown,  // A job with one frame, submitted elsewhere: runs of several '#'.
};
Numbering NumberingOf(const JobArguments& arguments);
// The requested frames; {1} if none are. Errors: those of ParseFrameRange.
absl::StatusOr<std::vector<int32_t>> FrameNumbers(const JobArguments& arguments);
// Checks the names that the arguments give. numbers: the frames'. Errors: kInvalidArgument if
// several frames would get one name, or "####" stands for no number; those of FindFrameNumber.
absl::Status CheckNumbers(const JobArguments& arguments, Numbering numbering,
                          const std::vector<int32_t>& numbers);

// The scene's file of each frame. Requires: CheckJobArguments is OK.
absl::StatusOr<FramePath> ScenePath(const JobArguments& arguments);

// The paths with #### in place of the frame's number. Requires: the job has frames. An output that
// ends in .png names a PNG and implies an EXR beside it. Errors: those of FindFrameNumber.
struct ImagePatterns {
  FramePath exr;
  FramePath png;  // Empty: no PNG.
  ImagePaths Of(int32_t frame_number) const { return {exr.Of(frame_number), png.Of(frame_number)}; }
};
absl::StatusOr<ImagePatterns> OutputPatterns(const JobArguments& arguments, Numbering numbering,
                                             const PreparedJob& job);
// The files on this machine that the job consists of.
std::vector<std::string> InputPaths(const PreparedJob& job);

// The view for the PNGs of these arguments, opened before any image exists. It is the default if no
// PNG is written and no view is named. Errors: those of ViewTransform::Open.
absl::StatusOr<ViewTransform> OpenView(const JobArguments& arguments);

v1::StopRule StopRuleOf(const StopArguments& stop, int frame_count);
v1::CreateJobRequest MakeCreateJobRequest(const JobArguments& arguments, const PreparedJob& job);

// A random UUID (version 4).
std::string MakeRequestId();

}  // namespace sheaf::cli
