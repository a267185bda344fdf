// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/job/prepared_job.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <filesystem>
#include <optional>
#include <thread>
#include <utility>
#include <variant>

#include "absl/strings/str_cat.h"
#include "cli/denoiser/external_denoiser.h"
#include "cli/job/frames/frame_notes.h"
#include "cli/job/frames/frame_range.h"
#include "cli/job/identity/digest_memory.h"
#include "cli/job/identity/file_digests.h"
#include "cli/job/input_check.h"
#include "cli/job/opened_scene.h"
#include "cli/job/output_files.h"
#include "cli/usd/usd_scene.h"
#include "common/base/digest.h"
#include "common/base/printable.h"
#include "common/base/status.h"
#include "common/base/text/utf8.h"
#include "common/rpc/manifest_codec.h"
#include "common/scene/camera_matrices.h"
#include "common/scene/file_source.h"
#include "common/scene/pbrt/scene_reader.h"
#include "common/scene/settings/path_shares.h"
#include "common/scene/visible_emitters.h"
#include "worker/render/scene/matte_names.h"
#include "worker/render/scene/memory_estimate.h"
#include "worker/render/scene/scene_check.h"

namespace sheaf::cli {
namespace {

namespace fs = std::filesystem;

// Scenes that are read concurrently: each may take gigabytes.
constexpr size_t kReadersMax = 4;

// One frame as read, with its blobs.
struct ReadFrameResult {
  PreparedFrame frame;
  std::vector<BlobSource> blobs;
  std::map<std::string, FileState> inputs;
  std::set<std::string> outside;
  bool is_photometric = false;
  std::vector<std::string> diagnostics;
  std::optional<SceneDescription> description;
};

// Whether a glTF file has lights of its own. Their units are candela and lux; those of environments
// are arbitrary.
bool IsPhotometric(const std::string& path, const SceneDescription& scene) {
  return IsGltfName(path) && std::ranges::any_of(scene.lights, [](const LightDescription& light) {
           return !std::holds_alternative<InfiniteLight>(light.light);
         });
}

// Samples of frames that stop early are not known before, and a continued image keeps its
// techniques: nothing is measured for these unasked.
std::optional<render::TechniqueEffort> EffortFor(const JobArguments& arguments) {
  if (arguments.settings.measure_techniques) return render::TechniqueEffort::kAsked;
  if (arguments.IsStereo() || arguments.settings.techniques || arguments.keep_camera_paths ||
      arguments.stop.IsActive() || !arguments.resume_from.empty()) {
    return std::nullopt;
  }
  return render::TechniqueEffort::kUnasked;
}

absl::StatusOr<ReadFrameResult> ReadFrame(const std::string& path, int32_t number,
                                          const RenderSettings& settings,
                                          std::optional<render::TechniqueEffort> effort,
                                          bool may_share, bool keeps_description, GltfInputs* gltf,
                                          FileDigests* digests, InputChecks* checks,
                                          PagedVolumes* volumes) {
  absl::StatusOr<SceneFile> file = ReadSceneFile(path, gltf, number);
  if (!file.ok()) return file.status();
  if (absl::Status status = checks->Check(file->read.scene, *file->files); !status.ok()) {
    return ChangeOr(status, *file->files);
  }
  ReadSceneResult& read = file->read;
  ReadFrameResult result;
  for (const SceneDiagnostic& diagnostic : read.diagnostics) {
    result.diagnostics.push_back(diagnostic.text);
  }
  const absl::StatusOr<std::set<std::string>> on_demand =
      volumes->Replace(read.scene, file->files.get(), &result.diagnostics);
  if (!on_demand.ok()) return on_demand.status();
  absl::StatusOr<FrameSettings> resolved = ResolveSettings(read, settings);
  if (!resolved.ok()) return Annotate(resolved.status(), path);
  if (const std::string note = CropNote(settings, *resolved); !note.empty()) {
    result.diagnostics.push_back(absl::StrCat(path, ": note: ", note));
  }
  const absl::StatusOr<std::string> techniques =
      ChooseTechniques(effort, may_share, read.scene, *file->files, &*resolved);
  if (!techniques.ok()) return techniques.status();
  if (!techniques->empty()) result.diagnostics.push_back(absl::StrCat(path, ": ", *techniques));
  if (resolved->outputs.HasIds()) {
    for (const std::string& line : render::MatteCollisions(read.scene)) {
      result.diagnostics.push_back(absl::StrCat(path, ": warning: ", line));
    }
  }
  std::vector<ManifestFile> files;
  for (const auto& [name, local_path] : file->files->FilesUsed()) {
    if (!IsUtf8(name)) {
      return absl::InvalidArgumentError(
          absl::StrCat(local_path, ": the name is not UTF-8, which a farm needs; rename the file"));
    }
    const absl::StatusOr<BlobDigest> digest = digests->Of(local_path);
    if (!digest.ok()) return digest.status();
    files.push_back({name, *digest, on_demand->contains(name)});
    result.blobs.push_back({*digest, local_path, ""});
  }
  // The hashed bytes are those that were read.
  result.inputs = file->files->States();
  result.outside = file->files->Outside();
  result.is_photometric = IsPhotometric(NameAsRead(path), read.scene);
  if (absl::Status status = CheckUnchanged(result.inputs); !status.ok()) return status;
  Manifest manifest =
      MakeManifest(NameAsRead(fs::path(path).filename().string()), std::move(files));
  CameraMatrices camera = CameraMatricesOf(read.scene.camera);
  manifest.world_to_camera = std::move(camera.world_to_camera);
  manifest.world_to_ndc = std::move(camera.world_to_ndc);
  if (absl::Status status = CheckManifest(manifest); !status.ok()) return status;
  const std::string bytes = EncodeManifest(manifest);
  const BlobDigest digest{Sha256Hex(bytes), bytes.size()};
  result.blobs.push_back({digest, "", bytes});
  result.frame = {number,
                  digest,
                  *resolved,
                  read.scene.film.filename,
                  read.scene.filter,
                  VisibleEmitters(read.scene, resolved->width_px, resolved->height_px)};
  result.frame.memory_bytes = render::EstimateMemory(read.scene, *file->files).TotalBytes();
  if (keeps_description) result.description = read.scene;
  absl::Status checked = render::CheckScene(std::move(read.scene), *resolved, *file->files);
  // Without its library (kFailedPrecondition) no image can be read; this is not an error of the
  // scene.
  if (!checked.ok() && !absl::IsFailedPrecondition(checked)) {
    return ChangeOr(checked, *file->files);
  }
  return result;
}

// path: the images to write. frame_number: the first one's.
absl::StatusOr<FramePath> PathOf(const std::string& path, Numbering numbering,
                                 int32_t frame_number) {
  if (numbering == Numbering::kUnasked) return FramePath{path};
  return FindFrameNumber(path, frame_number, numbering == Numbering::kAsked ? 1 : 2);
}

// The name of images without a name from the user: from the scene.
absl::StatusOr<FramePath> DefaultName(const JobArguments& arguments, Numbering numbering,
                                      const PreparedJob& job) {
  // The scene's own name for the image, if there is a single image. Its folder is ignored, since
  // it refers to the scene author's machine.
  if (job.frames.size() == 1 && !job.frames.front().film_filename.empty()) {
    fs::path name = fs::path(job.frames.front().film_filename).filename();
    return FramePath{name.replace_extension(".exr").string()};
  }
  fs::path name = fs::path(arguments.scene).filename();
  // A glTF file holds all frames, and the frames of a pattern may have a folder each.
  const bool has_number = numbering != Numbering::kUnasked &&
                          !IsGltfName(NameAsRead(arguments.scene)) && LongestRun(name) > 0;
  const bool needs_number = job.frames.size() > 1 && !has_number;
  name.replace_extension(needs_number ? ".####.exr" : ".exr");
  if (!has_number && !needs_number) return FramePath{name.string()};
  return FindFrameNumber(name.string(), job.frames.front().number);
}

}  // namespace

absl::Status CheckImageNames(const JobArguments& arguments) {
  if (absl::Status status = CheckImageFormat(arguments.format); !status.ok()) return status;
  if (absl::Status status = CheckDenoiser(arguments.denoise_with); !status.ok()) return status;
  const absl::Status status = CheckOutputName("-o", arguments.output, {".exr", ".png"});
  return status.ok() ? CheckOutputName("--png", arguments.png, {".png"}) : status;
}

absl::StatusOr<std::vector<int32_t>> FrameNumbers(const JobArguments& arguments) {
  if (arguments.frames.empty()) return std::vector<int32_t>{1};
  return ParseFrameRange(arguments.frames);
}

absl::StatusOr<FramePath> ScenePath(const JobArguments& arguments) {
  const std::string& scene = arguments.scene;
  const bool is_gltf = IsGltfName(NameAsRead(scene));
  if (arguments.frames.empty() || is_gltf) {
    std::error_code ignored;
    if (!is_gltf && scene.find('#') != std::string::npos && !fs::exists(scene, ignored)) {
      return absl::InvalidArgumentError(
          absl::StrCat(scene,
                       ": there is no file of this name; if # stands for a frame's number, "
                       "give --frames, for example --frames 1-24"));
    }
    return FramePath{scene};
  }
  const absl::StatusOr<std::vector<int32_t>> numbers = FrameNumbers(arguments);
  if (!numbers.ok()) return numbers.status();
  absl::StatusOr<FramePath> found = FindInputFrameNumber(scene, numbers->front());
  if (!found.ok() || found->HasNumber()) return found;
  return absl::InvalidArgumentError(
      absl::StrCat("--frames needs a glTF scene, or one with #### where the number goes, as in "
                   "shot.####.pbrt; got ",
                   scene));
}

Numbering NumberingOf(const JobArguments& arguments) {
  return arguments.frames.empty() ? Numbering::kUnasked : Numbering::kAsked;
}

absl::Status CheckNumbers(const JobArguments& arguments, Numbering numbering,
                          const std::vector<int32_t>& numbers) {
  const std::pair<const char*, std::string> names[] = {{"-o", arguments.output},
                                                       {"--png", arguments.png}};
  for (const auto& [flag, name] : names) {
    if (name.empty()) continue;
    if (numbering == Numbering::kUnasked && LongestRun(name) > 1) {
      return absl::InvalidArgumentError(
          absl::StrCat(flag, " ", name,
                       ": ## stands for a frame's number, but no frames are asked for; give "
                       "--frames, or another name"));
    }
    const absl::StatusOr<FramePath> found = PathOf(name, numbering, numbers.front());
    if (!found.ok()) return found.status();
    if (numbers.size() == 1 || found->HasNumber()) continue;
    return absl::InvalidArgumentError(
        absl::StrCat(flag, " ", name, ": the job has ", numbers.size(),
                     " frames; put #### where the number goes, as in out.####.exr"));
  }
  return absl::OkStatus();
}

namespace {

// Refuses options that stereo images, and those of shared paths, do not have.
absl::Status CheckSharedPaths(const JobArguments& arguments) {
  const std::optional<TechniqueSet>& techniques = arguments.settings.techniques;
  if (techniques && ReachesFarPixels(*techniques) && !arguments.resume_from.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat("--techniques ", techniques->Name(),
                     ": images whose paths count in several pixels know no "
                     "--resume-from; remove it"));
  }
  if (!arguments.IsStereo()) return absl::OkStatus();
  const std::pair<bool, const char*> refused[] = {
      {arguments.settings.eye_distance > 0 && !arguments.gltf.right_camera.empty(),
       "distance beside that of --right-camera"},
      {!arguments.resume_from.empty(), "--resume-from"},
      {arguments.format.exr.HasSeveralParts(), "--exr-parts multi"},
      {arguments.format.depth != ExrDepth::kRay, "--exr-depth plane"},
      {!arguments.denoise_with.empty(), "--denoise-with"}};
  for (const auto& [is_given, option] : refused) {
    if (is_given) {
      return absl::InvalidArgumentError(
          absl::StrCat("--stereo: images of two eyes know no ", option, "; remove it"));
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status CheckJobArguments(const JobArguments& arguments) {
  if (absl::Status status = CheckImageNames(arguments); !status.ok()) return status;
  if (absl::Status status = CheckSharedPaths(arguments); !status.ok()) return status;
  const absl::StatusOr<std::vector<int32_t>> numbers = FrameNumbers(arguments);
  if (!numbers.ok()) return numbers.status();
  if (absl::Status status = ScenePath(arguments).status(); !status.ok()) return status;
  if (!arguments.resume_from.empty() && numbers->size() > 1) {
    return absl::InvalidArgumentError(absl::StrCat(
        "--resume-from ", arguments.resume_from, ": an image holds one frame, but the job has ",
        numbers->size(), " frames; submit them one by one"));
  }
  return CheckNumbers(arguments, NumberingOf(arguments), *numbers);
}

absl::StatusOr<PreparedJob> PrepareJob(const JobArguments& arguments, bool keeps_description) {
  const std::optional<TechniqueSet>& asked = arguments.settings.techniques;
  if (arguments.keep_camera_paths &&
      (arguments.IsStereo() || (asked && ReachesFarPixels(*asked)))) {
    return absl::InvalidArgumentError(
        "--measure knows paths of one pixel; remove --stereo, and +sharing or "
        "+mutations of --techniques");
  }
  if (arguments.keep_camera_paths && asked && HasChains(*asked)) {
    return absl::InvalidArgumentError("--measure knows no chains; remove +chains of --techniques");
  }
  const absl::StatusOr<std::vector<int32_t>> numbers = FrameNumbers(arguments);
  if (!numbers.ok()) return numbers.status();
  const absl::StatusOr<FramePath> scene = ScenePath(arguments);
  if (!scene.ok()) return scene.status();
  DigestMemory memory(DigestMemory::DefaultPath());
  FileDigests digests(&memory);
  InputChecks checks;
  PagedVolumes volumes(arguments.paged_file_bytes_min, PagedVolumes::DefaultFolder(), &digests);
  GltfInputs gltf(arguments.gltf, arguments.size);
  RenderSettings settings = arguments.settings;
  if (arguments.stop.IsActive() && !settings.samples) settings.samples = kStoppedSamplesMax;
  // Resumed images have no shared paths, and denoisers expect independent pixels.
  const bool may_share = arguments.resume_from.empty() && arguments.denoise_with.empty();
  keeps_description &= numbers->size() == 1 && arguments.size.IsDefault();
  std::vector<std::optional<absl::StatusOr<ReadFrameResult>>> results(numbers->size());
  std::atomic<size_t> next{0};
  std::atomic<bool> failed{false};
  {
    std::vector<std::jthread> readers;
    const size_t reader_count = std::min(
        {kReadersMax, numbers->size(), std::max<size_t>(1, std::thread::hardware_concurrency())});
    for (size_t r = 0; r < reader_count; ++r) {
      readers.emplace_back([&] {
        for (size_t i = next++; i < results.size() && !failed; i = next++) {
          const int32_t number = (*numbers)[i];
          results[i].emplace(ReadFrame(scene->Of(number), number, settings, EffortFor(arguments),
                                       may_share, keeps_description, &gltf, &digests, &checks,
                                       &volumes));
          if (!results[i]->ok()) failed = true;
        }
      });
    }
  }
  PreparedJob job;
  job.derived = gltf.derived();
  FrameNotes notes;
  for (std::optional<absl::StatusOr<ReadFrameResult>>& result : results) {
    if (!result.has_value()) continue;  // Another frame failed first.
    if (!result->ok()) return result->status();
    job.frames.push_back((**result).frame);
    job.inputs.merge((**result).inputs);
    job.outside.merge((**result).outside);
    job.is_photometric |= (**result).is_photometric;
    if (keeps_description) job.description = std::move((**result).description);
    for (BlobSource& blob : (**result).blobs) {
      const std::string digest = blob.digest.sha256_hex;
      job.blobs.emplace(digest, std::move(blob));
    }
    const int32_t number = (**result).frame.number;
    for (const std::string& note : (**result).diagnostics) {
      notes.Add(number, scene->Of(number), note);
    }
  }
  job.diagnostics = notes.List();
  if (!arguments.resume_from.empty()) {
    const absl::StatusOr<BlobDigest> digest = digests.Of(arguments.resume_from);
    if (!digest.ok()) return digest.status();
    job.blobs.emplace(digest->sha256_hex, BlobSource{*digest, arguments.resume_from, ""});
    job.frames.front().resumed = *digest;
  }
  memory.Save();
  return job;
}

absl::StatusOr<ImagePatterns> OutputPatterns(const JobArguments& arguments, Numbering numbering,
                                             const PreparedJob& job) {
  const int32_t first = job.frames.front().number;
  absl::StatusOr<FramePath> exr = arguments.output.empty()
                                      ? DefaultName(arguments, numbering, job)
                                      : PathOf(arguments.output, numbering, first);
  if (!exr.ok()) return exr.status();
  absl::StatusOr<FramePath> png = PathOf(arguments.png, numbering, first);
  if (!png.ok()) return png.status();
  if (IsPng(exr->path)) {
    if (png->path.empty()) png = exr;
    exr->path = fs::path(exr->path).replace_extension(".exr").string();
  }
  return ImagePatterns{*std::move(exr), *std::move(png)};
}

std::vector<std::string> InputPaths(const PreparedJob& job) {
  std::vector<std::string> paths;
  for (const auto& [digest, blob] : job.blobs) {
    if (!blob.path.empty()) paths.push_back(blob.path);
  }
  return paths;
}

absl::StatusOr<ViewTransform> OpenView(const JobArguments& arguments) {
  const bool writes_png = !arguments.png.empty() || IsPng(arguments.output);
  if (!writes_png && !arguments.view.IsActive()) return ViewTransform();
  return ViewTransform::Open(arguments.view);
}

}  // namespace sheaf::cli
