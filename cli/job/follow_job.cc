// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/job/follow_job.h"

#include <algorithm>
#include <cstdio>
#include <map>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/time/clock.h"
#include "cli/denoiser/external_denoiser.h"
#include "cli/job/format/image_format.h"
#include "cli/job/format/plane_depth.h"
#include "cli/job/format/shown_layer.h"
#include "cli/job/frames/frame_range.h"
#include "cli/job/job_json.h"
#include "cli/job/output_files.h"
#include "cli/message.h"
#include "cli/progress_line.h"
#include "common/base/file.h"
#include "common/base/load_phases.h"
#include "common/base/printable.h"
#include "common/base/status.h"
#include "common/base/text/shell_quoted.h"
#include "common/film/exr/exr_codec.h"
#include "common/film/exr/external_layer.h"
#include "common/rpc/address.h"
#include "coordinator/core/job/job.h"

namespace sheaf::cli {
namespace {

constexpr uint64_t kImageBytesMax = uint64_t{16} << 30;

bool IsBlack(const FrameImage& image) {
  for (const char* name : {"R", "G", "B"}) {
    const std::vector<float>* plane = image.Find(name);
    if (plane == nullptr || std::ranges::any_of(*plane, [](float v) { return v != 0; })) {
      return false;
    }
  }
  return true;
}

// Rewrites the image with the denoiser's layer. delivered: its bytes from the farm. After an error
// the file at path is unchanged.
absl::Status AddDenoiserLayer(const std::string& path, const std::string& delivered,
                              const Delivery& delivery, const std::stop_token& stop,
                              FrameImage* image) {
  absl::Status status =
      AddExternalLayer(delivery.denoise_with, delivered, kDenoiserTimeMax, stop, image);
  if (status.ok()) {
    status = WriteFileAtomically(path, EncodeFrameImage(*image, delivery.format.exr));
  }
  if (status.ok()) return status;
  const std::string text = absl::StrCat(path, ": is written, but without the layer ",
                                        kExternalLayer, ": ", status.message());
  return absl::IsCancelled(status) ? absl::CancelledError(text)
                                   : absl::FailedPreconditionError(text);
}

// A frame's image as the farm delivered it.
struct Delivered {
  std::string bytes;
  FrameImage image;
};

// Errors: those of the calls; kDataLoss if the frame has another image.
absl::StatusOr<Delivered> Fetch(FarmClient* client, const v1::Frame& frame) {
  absl::StatusOr<std::string> bytes = client->ReadFrameOutput(frame.name(), kImageBytesMax);
  if (!bytes.ok()) return bytes.status();
  absl::StatusOr<FrameImage> image = DecodeFrameImage(*bytes);
  if (!image.ok()) return image.status();
  if (ImageDigest(*image) != frame.image_digest()) {
    return absl::DataLossError(
        absl::StrCat(frame.name(), ": its image is not the one that the coordinator delivered"));
  }
  return Delivered{*std::move(bytes), *std::move(image)};
}

absl::Status WriteExr(const std::string& path, const Delivered& delivered,
                      const ImageFormat& format) {
  const std::string& bytes =
      format.IsDefault() ? delivered.bytes : EncodeFrameImage(delivered.image, format.exr);
  if (absl::Status status = WriteFileAtomically(path, bytes); !status.ok()) return status;
  const absl::StatusOr<std::string> written = ReadWholeFile(path);
  if (!written.ok()) return written.status();
  return *written == bytes ? absl::OkStatus()
                           : absl::DataLossError("the disk has lost written data");
}

// An automatic exposure is part of what the PNG shows.
void NoteExposure(const Delivery& delivery, const FrameImage& image, const std::string& png) {
  if (!delivery.view.is_exposed_automatically()) return;
  PrintNote(absl::StrFormat("%s: exposed by %.2f stops, so that the average is middle gray; %s",
                            png, delivery.view.StopsFor(image),
                            delivery.paths.size() > 1
                                ? "each frame by its own: --exposure STOPS exposes all alike"
                                : "--exposure 0 shows the values of the EXR"));
}

// Errors: those of WriteOrKeep and AddExternalLayer.
absl::Status WriteImages(FarmClient* client, const v1::Frame& frame, const ImagePaths& paths,
                         const Delivery& delivery, Delivered delivered) {
  const ImageFormat& format = delivery.format;
  FrameImage* const image = &delivered.image;
  if (!format.IsDefault()) AddAttributes(format, frame, absl::Now(), image);
  if (format.depth == ExrDepth::kPlane) {
    if (const absl::Status made = MakePlaneDepth(image); !made.ok()) {
      PrintNote(absl::StrCat(paths.exr, ": ", made.message()));
    }
  }
  absl::Status status = WriteOrKeep(
      paths.exr, [&](const std::string& path) { return WriteExr(path, delivered, format); });
  if (!status.ok()) return status;
  absl::Status denoised;
  if (!delivery.denoise_with.empty()) {
    denoised = AddDenoiserLayer(paths.exr, delivered.bytes, delivery, client->stop(), image);
  }
  if (!paths.png.empty()) {
    const absl::StatusOr<FrameImage> shown = ImageOfLayer(*image, delivery.png_layer);
    if (!shown.ok()) return Annotate(shown.status(), paths.png);
    status = WriteOrKeep(
        paths.png, [&](const std::string& path) { return WriteView(delivery.view, *shown, path); });
    if (!status.ok()) return status;
    NoteExposure(delivery, *shown, paths.png);
  }
  if (const int64_t cut = format.exr.type == ExrType::kHalf ? CountBeyondHalf(*image) : 0;
      cut > 0) {
    PrintNote(absl::StrCat(paths.exr, ": ", cut,
                           " values beyond the range of 16-bit floats are cut at 65504; "
                           "--exr-type float keeps them"));
  }
  const bool is_black = IsBlack(*image);
  ImagePaths named = paths;
  const std::string layer =
      delivery.png_layer.empty() ? LeastNoisyLayer(*image) : delivery.png_layer;
  if (!named.png.empty() && layer != "image") absl::StrAppend(&named.png, " (", layer, ")");
  PrintInfo(absl::StrCat(FormatImageSummary(frame, named, delivery.detail),
                         is_black ? "; every pixel is black: no light of the scene reaches the "
                                    "camera (sheaf plan lists the lights)"
                                  : "",
                         is_black ? delivery.black_advice : ""));
  return denoised;
}

std::string MissingText(const v1::Job& job, const std::string& missing) {
  if (job.frames_size() == 1) return "it has no image";
  const bool is_one = missing.find_first_of(",-") == std::string::npos;
  return absl::StrCat(is_one ? "frame " : "frames ", missing, " of ", job.frames_size(),
                      is_one ? " has no image" : " have no image");
}

// The command that renders the missing images of a job on a farm.
std::string RemedyText(const v1::Job& job, const std::string& missing, const std::string& fetch) {
  const std::string again = job.frames_size() == 1
                                ? "submit it again"
                                : absl::StrCat("submit them again with --frames ", missing);
  if (job.state() == v1::Job::STATE_CANCELLED) return again;
  const std::string retry = absl::StrCat("sheaf retry ", job.name(), ", then ", fetch);
  if (!coordinator::IsSceneFailure(job.failure())) return "try again with: " + retry;
  return absl::StrCat("correct the scene and ", again);
}

absl::StatusOr<Delivery> MakeDelivery(const JobArguments& arguments, Numbering numbering,
                                      const PreparedJob& job, ViewTransform view) {
  const absl::StatusOr<ImagePatterns> patterns = OutputPatterns(arguments, numbering, job);
  if (!patterns.ok()) return patterns.status();
  Delivery delivery{{}, std::move(view), arguments.format, "", arguments.denoise_with};
  delivery.png_layer = arguments.png_layer;
  delivery.detail = arguments.detail;
  if (IsGltfName(NameAsRead(arguments.scene))) {
    delivery.black_advice = "; --environment names an image of a glTF scene's surroundings";
  }
  std::vector<std::string> outputs;
  for (const PreparedFrame& frame : job.frames) {
    const ImagePaths& paths = delivery.paths.emplace_back(patterns->Of(frame.number));
    outputs.insert(outputs.end(), {paths.exr, paths.png});
  }
  if (absl::Status status = CheckOutputs(outputs, InputPaths(job)); !status.ok()) return status;
  // For one frame, the names themselves: whether the user gave its number is not known later.
  const ImagePaths names = delivery.paths.size() == 1
                               ? delivery.paths.front()
                               : ImagePaths{patterns->exr.path, patterns->png.path};
  delivery.options = absl::StrCat("-o ", ShellQuoted(names.exr));
  for (const auto& [option, value] : FormatOptions(arguments.format)) {
    absl::StrAppend(&delivery.options, " ", option, value.empty() ? "" : " ",
                    value.empty() ? "" : ShellQuoted(value));
  }
  if (!arguments.denoise_with.empty()) {
    absl::StrAppend(&delivery.options, " --denoise-with ", ShellQuoted(arguments.denoise_with));
  }
  if (names.png.empty()) return delivery;
  std::string exposure = arguments.view.exposure;
  if (exposure.empty() && job.is_photometric) {
    exposure = kAutomaticExposure;
    delivery.view.set_exposure({.is_automatic = true});
  }
  for (const auto& [flag, value] :
       {std::pair("--png", names.png), std::pair("--png-layer", arguments.png_layer),
        std::pair("--ocio", arguments.view.config), std::pair("--display", arguments.view.display),
        std::pair("--view", arguments.view.view), std::pair("--exposure", exposure)}) {
    if (!value.empty()) absl::StrAppend(&delivery.options, " ", flag, " ", ShellQuoted(value));
  }
  return delivery;
}

}  // namespace

absl::StatusOr<Delivery> MakeDelivery(const JobArguments& arguments, const PreparedJob& job,
                                      ViewTransform view) {
  return MakeDelivery(arguments, NumberingOf(arguments), job, std::move(view));
}

absl::Status ProbeOutputs(const JobArguments& arguments) {
  const absl::StatusOr<std::vector<int32_t>> numbers = FrameNumbers(arguments);
  if (!numbers.ok()) return numbers.status();
  PreparedJob frames;
  for (const int32_t number : *numbers) frames.frames.push_back({number, {}, {}, ""});
  const absl::StatusOr<ImagePatterns> patterns =
      OutputPatterns(arguments, NumberingOf(arguments), frames);
  if (!patterns.ok()) return patterns.status();
  std::vector<std::string> outputs;
  for (const int32_t number : *numbers) {
    const ImagePaths paths = patterns->Of(number);
    outputs.insert(outputs.end(), {arguments.output.empty() ? "" : paths.exr, paths.png});
  }
  return CheckOutputs(outputs, {arguments.scene, arguments.resume_from});
}

absl::StatusOr<Delivery> MakeDelivery(JobArguments arguments, const v1::Job& job,
                                      ViewTransform view) {
  if (arguments.output.empty() && arguments.png.empty()) {
    if (arguments.denoise_with.empty()) {
      return Delivery{.paths = {},
                      .view = std::move(view),
                      .format = {},
                      .options = "",
                      .detail = arguments.detail};
    }
    return absl::InvalidArgumentError(
        "--denoise-with adds a layer to an image that is written: name it, as in -o room.exr");
  }
  PreparedJob frames;
  std::vector<int32_t> numbers;
  for (const v1::Frame& frame : job.frames()) {
    numbers.push_back(frame.spec().frame_number());
    frames.frames.push_back({numbers.back(), {}, {}, ""});
  }
  if (numbers.empty()) return absl::FailedPreconditionError(job.name() + ": has no frames");
  // Without --frames a job's frame is 1.
  const Numbering numbering =
      numbers == std::vector<int32_t>{1} ? Numbering::kUnknown : Numbering::kAsked;
  if (absl::Status status = CheckNumbers(arguments, numbering, numbers); !status.ok()) {
    return status;
  }
  arguments.scene = job.title();
  return MakeDelivery(arguments, numbering, frames, std::move(view));
}

std::string FetchCommand(const FarmClient& client, const std::string& name,
                         const Delivery& delivery) {
  return absl::StrCat("sheaf watch ", name,
                      client.address() == kCoordinatorAddress
                          ? ""
                          : absl::StrCat(" --coordinator ", ShellQuoted(client.address())),
                      delivery.options.empty() ? "" : " ", delivery.options);
}

ImageSaver::ImageSaver(FarmClient* client, const Delivery& delivery)
    : client_(client), delivery_(delivery), taken_(delivery.paths.size()) {}

bool ImageSaver::IsDue(const v1::Job& job, size_t i) const {
  const v1::Frame& frame = job.frames(static_cast<int>(i));
  if (!frame.complete() || frame.image_digest() == taken_[i].written) return false;
  return HasEnded(job) || frame.image_digest() != taken_[i].missed;
}

bool ImageSaver::HasWork(const v1::Job& job) const {
  for (size_t i = 0; i < FrameCount(job); ++i) {
    if (IsDue(job, i)) return true;
  }
  return false;
}

void ImageSaver::Save(const v1::Job& job) {
  for (size_t i = 0; i < FrameCount(job) && !stopped_; ++i) {
    if (IsDue(job, i)) SaveFrame(job, i);
  }
}

void ImageSaver::SaveFrame(const v1::Job& job, size_t i) {
  const PhaseTimer timer(LoadPhase::kDelivery);
  const v1::Frame& frame = job.frames(static_cast<int>(i));
  absl::StatusOr<Delivered> delivered = Fetch(client_, frame);
  if (!delivered.ok()) {
    stopped_ = absl::IsCancelled(delivered.status()) || absl::IsUnavailable(delivered.status());
    // While the job runs, the frame may have restarted, for a refinement or a correction.
    taken_[i].missed = frame.image_digest();
    if (stopped_ || HasEnded(job)) NoteFailure(delivered.status(), &call_);
    return;
  }
  taken_[i].written = frame.image_digest();
  const absl::Status status =
      WriteImages(client_, frame, delivery_.paths[i], delivery_, *std::move(delivered));
  stopped_ = absl::IsCancelled(status);
  if (!status.ok()) NoteFailure(status, &file_);
}

void ImageSaver::NoteFailure(const absl::Status& status, absl::Status* first) {
  if (first->ok()) {
    *first = status;
  } else {
    ReportError(ExitCode::kFile, status);
  }
}

size_t ImageSaver::FrameCount(const v1::Job& job) const {
  return std::min(taken_.size(), static_cast<size_t>(job.frames_size()));
}

absl::StatusOr<v1::Job> FollowJob(FarmClient* client, const std::string& name, bool json,
                                  ImageSaver* images) {
  ProgressLine line;
  return client->WatchJob(name, [&](const v1::Job& job) {
    if (json) {
      std::printf("%s\n", JobJson(job).c_str());
      std::fflush(stdout);
    } else {
      line.Show(job.name(), FractionDone(job.progress()), FormatProgress(job));
    }
    if (!images->HasWork(job)) return;
    line.Finish();
    images->Save(job);
  });
}

std::string MissingImages(const v1::Job& job) {
  std::vector<int32_t> numbers;
  for (const v1::Frame& frame : job.frames()) {
    if (!frame.complete()) numbers.push_back(frame.spec().frame_number());
  }
  return FormatFrameRange(numbers);
}

ExitCode ReportEnd(const v1::Job& job, bool images_written, const std::string& remedy,
                   Detail detail) {
  const std::string missing = MissingImages(job);
  const std::string rest = missing.empty() || remedy.empty()
                               ? ""
                               : absl::StrCat("; ", MissingText(job, missing), "; ", remedy);
  if (job.state() == v1::Job::STATE_CANCELLED) {
    return ReportError(ExitCode::kCancelled,
                       absl::CancelledError(absl::StrCat(job.name(), " was cancelled", rest)));
  }
  if (job.state() == v1::Job::STATE_FAILED) {
    return ReportError(ExitCode::kFailed, absl::FailedPreconditionError(absl::StrCat(
                                              job.name(), " failed: ", job.failure(), rest)));
  }
  // For a single image, the lines printed when it was written say the same.
  const bool is_reported = images_written && job.frames_size() == 1;
  if (!is_reported) PrintInfo(FormatJobSummary(job, detail));
  if (!job.warning().empty()) {
    PrintInfo(absl::StrCat("warning: ", job.name(), ": ", Printable(job.warning())));
  }
  return ExitCode::kOk;
}

ExitCode FollowToTheEnd(FarmClient* client, const std::string& name, bool json,
                        const Delivery& delivery) {
  const std::string fetch = FetchCommand(*client, name, delivery);
  ImageSaver images(client, delivery);
  const absl::StatusOr<v1::Job> job = FollowJob(client, name, json, &images);
  if (absl::IsCancelled(job.status())) {
    return ReportError(
        ExitCode::kInterrupted,
        absl::CancelledError(absl::StrCat(
            name, " continues in the background; ",
            delivery.paths.empty() ? "watch it with: " : "download its images with: ", fetch,
            "; end it with: sheaf cancel ", name)));
  }
  if (!job.ok()) return ReportCallError(job.status());
  if (const absl::Status saved = images.status(); !saved.ok()) {
    PrintInfo(absl::StrCat(name, " has ended; download its images with: ", fetch));
    const ExitCode code =
        images.has_call_failed() ? ReportCallError(saved) : ReportError(ExitCode::kFile, saved);
    if (job->state() == v1::Job::STATE_SUCCEEDED) return code;
  }
  const std::string remedy =
      delivery.paths.empty() ? "" : RemedyText(*job, MissingImages(*job), fetch);
  return ReportEnd(*job, !delivery.paths.empty(), remedy, delivery.detail);
}

}  // namespace sheaf::cli
