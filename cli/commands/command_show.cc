// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// sheaf show: prints a job with its frames, or the facts of an image, and displays the image in
// terminals that can show one.
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "cli/commands/farm_command.h"
#include "cli/commands/shown_job.h"
#include "cli/error_text.h"
#include "cli/image/terminal_image.h"
#include "cli/image/view_transform.h"
#include "cli/job/job_json.h"
#include "cli/message.h"
#include "common/command_line/command_line.h"
#include "common/film/denoised_output.h"
#include "common/film/error/eye_errors.h"
#include "common/film/exr/exr_codec.h"
#include "common/film/exr/external_layer.h"
#include "coordinator/core/frame/error_curve.h"
#include "coordinator/service/http/image/image_layer.h"

namespace sheaf::cli {
namespace {

// Limit for images shown without --image: larger ones are not fetched.
constexpr uint64_t kUnaskedBytesMax = uint64_t{256} << 20;
constexpr uint64_t kAskedBytesMax = uint64_t{16} << 30;
constexpr const char* kAuto = "auto";

std::string Variable(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? "" : value;
}

void PrintFile(const std::string& path, const FrameImage& image, bool json) {
  const int width = image.window.Width(), height = image.window.Height();
  if (json) {
    const nlohmann::ordered_json object = {{"path", path},
                                           {"width_px", width},
                                           {"height_px", height},
                                           {"image_digest", ImageDigest(image)},
                                           {"channels", image.channel_names},
                                           {"metadata", image.metadata}};
    std::printf("%s\n", object.dump().c_str());
    return;
  }
  std::printf("%s  %dx%d, %zu channels, %s\n", path.c_str(), width, height,
              image.channel_names.size(), ImageDigest(image).substr(0, 16).c_str());
  // Errors recorded in the file when it was delivered.
  for (const auto& [key, name] :
       {std::pair{"relativeMse", "error"}, std::pair{kLeftEyeErrorKey, "error of the left eye"},
        std::pair{kRightEyeErrorKey, "error of the right eye"},
        std::pair{kEyeDifferenceErrorKey, "error of their difference"}}) {
    const auto found = image.metadata.find(key);
    double relative_mse = 0;
    if (found != image.metadata.end() && absl::SimpleAtod(found->second, &relative_mse)) {
      std::printf("estimated %-7s %s\n", name, FormatBothErrors(relative_mse).c_str());
    }
  }
  double flip = 0;
  if (const auto found = image.metadata.find("flip");
      found != image.metadata.end() && absl::SimpleAtod(found->second, &flip)) {
    std::printf("estimated %-7s %.2g\n", "FLIP", flip);
  }
  const auto curve = image.metadata.find(coordinator::kErrorCurveKey);
  if (curve == image.metadata.end()) return;
  const std::vector<coordinator::ErrorPoint> points = coordinator::ParseErrorCurve(curve->second);
  if (points.empty()) return;
  std::printf("%10s  %-10s %s\n", "samples", "error", "at most (95 %)");
  for (const coordinator::ErrorPoint& point : points) {
    // The plus-minus sign has two bytes and one column.
    std::printf("%10.1f  %-11s %s\n", point.samples, FormatPixelError(point.relative_mse).c_str(),
                FormatPixelError(point.relative_mse_upper).c_str());
  }
}

// An image and its caption.
struct ShownLayer {
  ShownImage image;
  PngTags tags;
  std::string caption;
};

// The image with channels of another layer in place of NAME.{R,G,B}; with an empty name, in place
// of R, G and B. Errors: kInvalidArgument if it has no such layer.
absl::Status Substitute(const char* layer, const char* name, const char* option,
                        FrameImage* image) {
  for (const char* component : {"R", "G", "B"}) {
    std::vector<float>* const to =
        image->Find(name[0] == '\0' ? component : absl::StrCat(name, ".", component));
    const std::vector<float>* const from = image->Find(absl::StrCat(layer, ".", component));
    if (to == nullptr || from == nullptr) {
      return absl::InvalidArgumentError(absl::StrCat("--layer: the image has no layer ", layer,
                                                     "; ", option,
                                                     " of render and submit adds it"));
    }
    *to = *from;
  }
  return absl::OkStatus();
}

// The layer as a screen displays it. False colors are the same as on the dashboard.
absl::StatusOr<ShownLayer> ShowLayer(const FrameImage& image, coordinator::ImageLayer layer,
                                     const ViewTransform& view) {
  ShownLayer shown;
  if (layer == coordinator::ImageLayer::kImage) {
    absl::StatusOr<std::vector<Rgb8>> pixels = view.Show(image);
    if (!pixels.ok()) return pixels.status();
    shown.image = {image.window.Width(), image.window.Height(), *std::move(pixels)};
    shown.tags = view.Tags();
    return shown;
  }
  for (const std::string& channel : coordinator::ChannelsOf(layer)) {
    if (image.Find(channel) != nullptr) continue;
    return absl::InvalidArgumentError(absl::StrCat("--layer: the image has no channel ", channel));
  }
  absl::StatusOr<coordinator::DisplayImage> display = coordinator::MakeDisplayImage(image, layer);
  if (!display.ok()) return display.status();
  shown.image = {display->width_px, display->height_px, std::move(display->pixels)};
  if (display->range) {
    const bool is_error = layer == coordinator::ImageLayer::kError;
    shown.caption = absl::StrFormat("%s: dark blue %g, yellow %g",
                                    is_error ? "relative error" : "samples per pixel",
                                    display->range->low, display->range->high);
  }
  return shown;
}

class ShowCommand : public FarmCommand {
 public:
  CLI::App* AddTo(CLI::App* app) override {
    CLI::App* command =
        AddCommon(app, "show", "Show a job with its frames, or an image, also in the terminal");
    command->add_option("JOB", target_, "The job, as in jobs/7 or 7, or an image, as in room.exr")
        ->required();
    command
        ->add_flag("--image{auto}", graphics_name_,
                   "Print the image even if standard output is not a terminal; --image=kitty, "
                   "iterm, blocks, blocks256 (without 24-bit colors) or none selects the method "
                   "(default: from TERM, TERM_PROGRAM, KITTY_WINDOW_ID and COLORTERM)")
        ->check(IsOneOf({kAuto, "kitty", "iterm", "blocks", "blocks256", "none"}));
    command
        ->add_option("--layer", layer_name_,
                     "The layer to print: image, denoised or denoised_external, or false colors: "
                     "the relative error (error, denoisedError) or the number of samples")
        ->check(IsOneOf(
            {"image", "error", "samples", kDenoisedLayer, kDenoisedErrorLayer, kExternalLayer}))
        ->capture_default_str();
    command->add_option("--frame", frame_number_,
                        "The frame whose image is printed (default: the last finished frame)");
    AddViewOptions(command, &view_arguments_);
    command->footer(
        "Examples:\n"
        "  sheaf show jobs/7\n"
        "  sheaf show 7 --json\n"
        "  sheaf show room.exr --layer error\n"
        "  sheaf show room.exr --layer denoised\n"
        "  sheaf show 7 --frame 12 --view \"ACES 1.0 SDR\" --image=blocks | less -R");
    return command;
  }

  ExitCode Run() override {
    ChooseGraphics();
    if (graphics_ != TerminalGraphics::kNone || view_arguments_.IsActive()) {
      absl::StatusOr<ViewTransform> view = ViewTransform::Open(view_arguments_);
      if (view.ok()) {
        view_ = *std::move(view);
      } else if (IsAsked() || view_arguments_.IsActive()) {
        return ReportError(ExitCode::kUsage, view.status());
      } else {
        // A bad config from the environment must not prevent the other output.
        PrintNote(absl::StrCat("no image: ", view.status().message()));
        graphics_ = TerminalGraphics::kNone;
      }
    }
    if (!absl::EndsWithIgnoreCase(target_, ".exr")) return FarmCommand::Run();
    const absl::StatusOr<FrameImage> image = ReadFrameImage(target_);
    if (!image.ok()) return ReportError(ExitCode::kFile, image.status());
    PrintFile(target_, *image, json());
    return PrintImage(*image);
  }

 protected:
  ExitCode RunWith(FarmClient* client) override {
    const absl::StatusOr<v1::Job> job = client->GetJob(JobName(target_));
    if (!job.ok()) return ReportCallError(job.status());
    if (absl::Status status = CheckFrame(*job); !status.ok()) {
      return ReportError(ExitCode::kFailed, status);
    }
    if (json()) {
      std::printf("%s\n", JobJson(*job).c_str());
    } else {
      PrintJob(*job);
    }
    if (graphics_ == TerminalGraphics::kNone) return ExitCode::kOk;
    const v1::Frame* frame = FindFrame(*job);
    if (frame == nullptr) return ReportNoFrame();
    const absl::StatusOr<std::string> bytes =
        client->ReadFrameOutput(frame->name(), IsAsked() ? kAskedBytesMax : kUnaskedBytesMax);
    if (absl::IsOutOfRange(bytes.status())) {
      PrintNote("the image is large; give --image to show it");
      return ExitCode::kOk;
    }
    if (!bytes.ok()) return ReportCallError(bytes.status());
    const absl::StatusOr<FrameImage> image = DecodeFrameImage(*bytes);
    if (!image.ok()) return ReportError(ExitCode::kFailed, image.status());
    return PrintImage(*image);
  }

 private:
  bool IsAsked() const { return !graphics_name_.empty(); }

  void ChooseGraphics() {
    const bool is_terminal = ::isatty(STDOUT_FILENO) == 1;
    if (IsAsked() && graphics_name_ != kAuto) {
      graphics_ = TerminalGraphicsFromName(graphics_name_).value_or(TerminalGraphics::kNone);
    } else if (is_terminal && !json()) {
      graphics_ = DetectGraphics(Variable);
    }
    if (graphics_name_ == kAuto && graphics_ == TerminalGraphics::kNone) {
      graphics_ = TerminalGraphics::kBlocks;
    }
  }

  // Errors: kNotFound, if the job has no such frame, be it finished or not.
  absl::Status CheckFrame(const v1::Job& job) const {
    const auto is_asked = [this](const v1::Frame& frame) {
      return frame.spec().frame_number() == *frame_number_;
    };
    if (!frame_number_ || std::ranges::any_of(job.frames(), is_asked)) return absl::OkStatus();
    std::string numbers;
    for (const int at : {0, job.frames_size() - 1}) {
      const int number = job.frames(at).spec().frame_number();
      absl::StrAppend(&numbers, numbers.empty() ? "" : " to ", number);
    }
    return absl::NotFoundError(
        absl::StrCat(job.name(), ": has no frame ", *frame_number_, ", only ", numbers));
  }

  // The requested frame or, without a request, the last frame that has an image. Null if there is
  // none.
  const v1::Frame* FindFrame(const v1::Job& job) const {
    const v1::Frame* found = nullptr;
    for (const v1::Frame& frame : job.frames()) {
      const bool fits = !frame_number_ || frame.spec().frame_number() == *frame_number_;
      if (fits && frame.complete()) found = &frame;
    }
    return found;
  }

  // A missing image is an error only if one was requested.
  ExitCode ReportNoFrame() const {
    if (!IsAsked() && !frame_number_) return ExitCode::kOk;
    return ReportError(ExitCode::kFailed,
                       absl::NotFoundError(absl::StrCat(
                           JobName(target_), ": no finished frame",
                           frame_number_ ? absl::StrCat(" ", *frame_number_) : "", " to show")));
  }

  absl::StatusOr<ShownLayer> ShowByName(const FrameImage& image) const {
    if (const auto layer = coordinator::ImageLayerFromName(layer_name_)) {
      return ShowLayer(image, *layer, view_);
    }
    FrameImage shown = image;
    const bool is_external = layer_name_ == kExternalLayer;
    absl::Status status = Substitute(is_external ? kExternalLayer : kDenoisedLayer, "",
                                     is_external ? "--denoise-with" : "--denoise", &shown);
    const bool is_error = layer_name_ == kDenoisedErrorLayer;
    if (status.ok() && is_error) {
      status = Substitute(kDenoisedErrorLayer, "stderr", "--denoise", &shown);
    }
    if (!status.ok()) return status;
    using coordinator::ImageLayer;
    return ShowLayer(shown, is_error ? ImageLayer::kError : ImageLayer::kImage, view_);
  }

  ExitCode PrintImage(const FrameImage& image) const {
    if (graphics_ == TerminalGraphics::kNone) return ExitCode::kOk;
    absl::StatusOr<ShownLayer> shown = ShowByName(image);
    if (!shown.ok()) return ReportError(ExitCode::kFailed, shown.status());
    const absl::StatusOr<std::string> text = TerminalText(graphics_, MeasureTerminal(STDOUT_FILENO),
                                                          std::move(shown->image), shown->tags);
    if (!text.ok()) return ReportError(ExitCode::kFailed, text.status());
    std::fwrite(text->data(), 1, text->size(), stdout);
    if (!shown->caption.empty()) std::printf("%s\n", shown->caption.c_str());
    return ExitCode::kOk;
  }

  std::string target_, graphics_name_, layer_name_ = "image";
  std::optional<int32_t> frame_number_;
  ViewArguments view_arguments_;
  ViewTransform view_;
  TerminalGraphics graphics_ = TerminalGraphics::kNone;
};

}  // namespace

std::unique_ptr<Command> MakeShowCommand() { return std::make_unique<ShowCommand>(); }

}  // namespace sheaf::cli
