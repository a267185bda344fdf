// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/commands/options.h"
#include "cli/commands/stop_options.h"

#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "cli/commands/format_options.h"
#include "cli/commands/stereo_option.h"
#include "common/base/label.h"
#include "common/base/nearest_name.h"
#include "common/command_line/command_line.h"
#include "common/film/denoised_output.h"
#include "common/film/exr/external_layer.h"
#include "common/rpc/address.h"
#include "common/scene/film_size.h"

namespace sheaf::cli {
namespace {

constexpr int kTileSizePxMax = 1024;
constexpr double kSizePercentMax = 10000;
constexpr char kImageGroup[] = "Output images";

// Parses "x0,y0,x1,y1", half-open.
PixelRect ParseCrop(const std::string& text) {
  const std::vector<std::string> items = absl::StrSplit(text, ',');
  PixelRect rect;
  int32_t* const edges[] = {&rect.x0, &rect.y0, &rect.x1, &rect.y1};
  bool valid = items.size() == 4;
  for (size_t i = 0; valid && i < 4; ++i) valid = absl::SimpleAtoi(items[i], edges[i]);
  if (!valid || rect.x0 < 0 || rect.y0 < 0 || rect.x1 <= rect.x0 || rect.y1 <= rect.y0) {
    throw CLI::ValidationError("--crop", text +
                                             ": expected X0,Y0,X1,Y1 in pixels with X0 < X1 and "
                                             "Y0 < Y1, as in 200,80,456,272");
  }
  return rect;
}

void AddOutputs(const std::string& names, FilmOutputs* outputs) {
  const absl::Status status = AddAovs(names, outputs);
  if (!status.ok()) throw CLI::ValidationError("--aov", std::string(status.message()));
}

std::string CheckPowerOfTwo(const std::string& text) {
  uint64_t value = 0;
  if (absl::SimpleAtoi(text, &value) && value > 0 && (value & (value - 1)) == 0) return "";
  return absl::StrCat("\"", text, "\" is not a power of two, as 16 and 64 are");
}

std::string CheckExposure(const std::string& text) {
  return std::string(ParseExposure(text).status().message());
}

// Options for layers beside the colors, and for the primaries of the colors.
void AddOutputOptions(CLI::App* command, RenderSettings* settings) {
  const OptionGroup group(command, "Image contents");
  std::vector<std::pair<std::string, Primaries>> primaries;
  for (const std::string& name : PrimariesNames()) {
    primaries.emplace_back(name, *PrimariesFromName(name));
  }
  AddChoice(
      command, "--primaries", &settings->primaries, primaries,
      "Primaries of the image's R, G, B, all linear (default: the ColorSpace at the scene's Film)");
  AddList(
      command, "--aov",
      {"position", "normal-geometric", "normal-shading", "uv", "motion", "object-id", "material-id",
       "asset-id"},
      [settings](const std::string& text) { AddOutputs(text, &settings->outputs); },
      "Also write these quantities of the first surface", " (see docs/outputs.md)");
  AddList(
      command, "--cryptomatte", {"object", "material", "asset"},
      [settings](const std::string& text) {
        const absl::Status status = AddCryptomattes(text, &settings->outputs);
        if (!status.ok()) {
          throw CLI::ValidationError("--cryptomatte", std::string(status.message()));
        }
      },
      "Also write these mattes");
  command->add_flag("--light-groups", settings->light_groups,
                    "Write the contribution of each group of lights (\"string lightgroup\")");
  command->add_flag("--light-paths", settings->light_paths,
                    "Write the contribution of each kind of path: direct, caustic, fog ...");
  command->add_flag_callback(
      "--denoise", [settings] { AddDenoised(&settings->outputs); },
      "Also write an image with less noise and its expected error (layers denoised and "
      "denoisedError; see docs/denoise.md)");
}

std::string CheckOneLine(const std::string& text) {
  return text.find('\n') == std::string::npos ? "" : "the name has several lines; write one";
}

// Parses "640x480" or "50%".
FilmSize ParseSize(const std::string& text) {
  FilmSize size;
  double percent = 0;
  if (absl::EndsWith(text, "%") && absl::SimpleAtod(text.substr(0, text.size() - 1), &percent) &&
      percent > 0 && percent <= kSizePercentMax) {
    size.fraction = percent / 100;
    return size;
  }
  const std::vector<std::string> items = absl::StrSplit(text, 'x');
  const auto parse = [](const std::string& item, int32_t* pixels) {
    return absl::SimpleAtoi(item, pixels) && *pixels > 0 && *pixels <= GltfView::kSizePxMax;
  };
  if (items.size() == 2 && parse(items[0], &size.width_px) && parse(items[1], &size.height_px)) {
    return size;
  }
  throw CLI::ValidationError("--size", text +
                                           ": expected WIDTHxHEIGHT in pixels, as in 640x480, "
                                           "or a part of the scene's size, as in 50%");
}

// Options that say what a glTF file leaves open.
void AddGltfOptions(CLI::App* command, GltfArguments* gltf) {
  const OptionGroup group(command, "glTF scenes");
  const CLI::Validator one_line(CheckOneLine, "");
  command
      ->add_option("--camera", gltf->camera,
                   "Camera, by its name or its node's (default: the first; if there is none, one "
                   "that sees the whole scene)")
      ->check(one_line);
  command
      ->add_option("--right-camera", gltf->right_camera,
                   "Camera of the right eye, with --camera that of the left one: renders both as "
                   "--stereo does. They look in the same direction")
      ->check(one_line);
  command
      ->add_option("--animation", gltf->animation,
                   "Animation, by its name (default: the first, with those that move other things)")
      ->check(one_line);
  command->add_option("--fps", gltf->fps, "Frames per second: frame N shows (N - 1) / fps seconds")
      ->check(InRange(1e-3, GltfArguments::kFpsMax))
      ->capture_default_str();
  command
      ->add_option("--shutter", gltf->shutter,
                   "How long the shutter is open, in frames; 0: no motion blur")
      ->check(InRange(0.0, 1.0))
      ->capture_default_str();
  command
      ->add_option("--environment", gltf->environment,
                   "Image of what surrounds the scene: equirectangular, .exr or .hdr; or none "
                   "(default: a gray one, bright above, if the file has no lights)")
      ->check([](const std::string& name) {
        return name == GltfView::kNoEnvironment ? "" : IsFile()(name);
      });
}

// --denoise-with.
void AddPngOptions(CLI::App* command, JobArguments* arguments) {
  command->add_option("--png", arguments->png, "Also write a PNG");
  AddChoice(
      command, "--png-layer", &arguments->png_layer,
      std::vector<std::pair<std::string, std::string>>{
          {"image", "image"}, {kDenoisedLayer, kDenoisedLayer}, {kExternalLayer, kExternalLayer}},
      "The layer that PNGs show (default: that of --denoise-with or --denoise, without them "
      "the image)");
}

void AddDenoiserOption(CLI::App* command, JobArguments* arguments) {
  const OptionGroup group(command, kImageGroup);
  command
      ->add_option("--denoise-with", arguments->denoise_with,
                   "Denoise each EXR by this command of your own, which runs on this machine with "
                   "two more words: the EXR to read, and the one to write. Its result becomes the "
                   "layer denoised_external; nothing is replaced (see docs/denoise.md)")
      ->type_name("COMMAND");
}

void AddVerboseFlag(CLI::App* command, JobArguments* arguments) {
  command->add_flag_callback(
      "--verbose", [arguments] { arguments->detail = Detail::kAll; },
      "Results also have rates, FLIP and the causes of noise");
}

constexpr char kTechniquesOption[] = "--techniques";
constexpr char kMeasuredTechniques[] = "auto";

// The usual values of --techniques. Further words may be joined, in any order.
std::vector<std::string> TechniquesWords() {
  std::vector<std::string> words{kMeasuredTechniques};
  for (const TechniqueSet techniques : kNumberedTechniques) words.push_back(techniques.Name());
  return words;
}

void ParseTechniques(const std::string& text, RenderSettings* settings) {
  settings->techniques.reset();
  settings->measure_techniques = absl::EqualsIgnoreCase(text, kMeasuredTechniques);
  if (settings->measure_techniques) return;
  const absl::StatusOr<TechniqueSet> techniques = TechniqueSet::Parse(text);
  if (techniques.ok()) {
    settings->techniques = *techniques;
    return;
  }
  const std::vector<std::string> words = TechniquesWords();
  throw CLI::ValidationError(
      kTechniquesOption,
      absl::IsNotFound(techniques.status())
          ? absl::StrCat("\"", text, "\" is not one of ", absl::StrJoin(words, ", "),
                         " or these with +learned-lights, +product, +merging or "
                         "+emission-guiding, or camera "
                         "with +sharing, +sharing+views, +mutations or +chains",
                         NearestNameHint(text, words))
          : std::string(techniques.status().message()));
}

// Options for light transport.
void AddTransportOptions(CLI::App* command, RenderSettings* settings) {
  const OptionGroup group(command, "Light transport");
  AddChoice(
      command, "--color", &settings->color,
      std::vector<std::pair<std::string, ColorTransport>>{{"auto", ColorTransport::kAuto},
                                                          {"rgb", ColorTransport::kRgb},
                                                          {"spectral", ColorTransport::kSpectral}},
      "Values that a path carries: rgb, spectral (four wavelengths), or auto: spectral if light is "
      "dispersed, a color lies outside sRGB, or the film names a sensor");
  command->add_flag("--single-scattering", settings->single_scattering,
                    "Rough surfaces scatter light once and lose the rest, as in pbrt-v4");
  command
      ->add_option("--clamp", settings->max_component_value,
                   "Largest X, Y and Z of a sample, above which its light is lost: fewer bright "
                   "specks, but BIASED, and displayed errors do not include the bias (default: "
                   "the scene's \"maxcomponentvalue\"; 0: none)")
      ->check(InRange(0.0));
  command->add_flag("--one-sequence", settings->one_sequence,
                    "Draw a pixel's samples from one sequence, not from 16 independent ones: less "
                    "noise in smooth regions, but displayed errors are upper estimates");
  command
      ->add_option(
          "--similarity", settings->similarity_after,
          "Scatterings in media after which a path treats media as isotropic and thinner: faster "
          "in dense media, but BIASED, and displayed errors do not include the bias; 0: never")
      ->check(InRange(0, kSimilarityAfterMax))
      ->capture_default_str();
  command
      ->add_option(
          "--light-samples", settings->light_samples,
          "Most light samples at a vertex. With more than 1, lights are split into parts where it "
          "is uncertain which of them matter, and each part is sampled: less noise for more time, "
          "where many lights are near. The limit halves with each scattering; vertices in media "
          "take 1")
      ->check(InRange(1, kLightSamplesMax))
      ->capture_default_str();
  command
      ->add_option_function<std::string>(
          kTechniquesOption,
          [settings](const std::string& text) { ParseTechniques(text, settings); },
          "Where paths begin: at the camera; at the camera and at lights, which finds caustics and "
          "small lights behind glass sooner; or at lights alone where possible. +guiding: paths "
          "from the camera also go where a training, before the first sample, found light, for "
          "rooms that are lit indirectly. +splitting: several paths leave where that light "
          "matters most. +emission-guiding: paths from lights begin where, as the training found, "
          "light reaches the picture, for pictures of a small part of the scene. +learned-lights: "
          "vertices sample the lights that a short training found to be seen from there, for many "
          "lights behind walls. +product: glossy surfaces sample the lights that they reflect "
          "to the camera, for many lights over them; off beside light paths. "
          "+merging: paths "
          "from lights also find what the camera sees through smooth glass or in mirrors; BIASED "
          "by a blur, which errors include. +sharing: paths from the camera count in all pixels "
          "whose filters cover them; +views: and through several points of the lens and, if only "
          "the camera moves, times of the shutter. +mutations: samples far brighter than their "
          "region are spread over chains of similar paths. +chains: paths from the camera are "
          "connected to small lamps through smooth glass and mirrors. All but merging have the "
          "same mean. auto: what pays most, +sharing and +views included, which small images "
          "measure first (default: those of the scene's integrator; for paths "
          "from the camera, in render, submit and quote, auto where the first of these images are "
          "a "
          "hundredth of the frame)")
      ->type_name(absl::StrJoin(TechniquesWords(), "|"));
  command->add_flag("--generic", settings->force_generic_variant,
                    "Run the variant that supports every effect; changes no pixel");
}

}  // namespace

void AddCoordinatorOption(CLI::App* command, FarmAddress* coordinator) {
  command
      ->add_option(
          "--coordinator", coordinator->address,
          absl::StrCat("Address of the coordinator, HOST:PORT or HOST (port ", kCoordinatorPort,
                       "); of several that share a farm: all, separated by commas"))
      ->transform(CLI::Validator(CompleteCoordinatorAddress, ""))
      ->envname("SHEAF_COORDINATOR")
      ->type_name("ADDRESS")
      ->capture_default_str();
  command->add_flag("--insecure", coordinator->insecure,
                    "For experiments: connect without encryption to a coordinator on another "
                    "machine");
}

void AddJsonFlag(CLI::App* command, bool* json) {
  command->add_flag("--json", *json, "Print JSON for scripts, one object per line");
}

void AddSettingsOptions(CLI::App* command, JobArguments* arguments) {
  RenderSettings& settings = arguments->settings;
  const OptionGroup group(command, "Scene and samples");
  command->add_option("SCENE", arguments->scene, "Scene file: pbrt-v4, glTF 2.0, or USD")
      ->required();
  command->add_option("--samples", settings.samples, "Samples per pixel (default: the scene's)")
      ->check(InRange(int64_t{1}));
  command
      ->add_option("--max-depth", settings.max_depth,
                   "Maximum number of bounces (default: the scene's)")
      ->check(InRange(int64_t{0}));
  command->add_option("--seed", settings.seed, "Seed of all samples (default: the scene's)");
  command->add_option_function<std::string>(
      "--crop", [&settings](const std::string& text) { settings.crop = ParseCrop(text); },
      "Render only the pixels X0,Y0,X1,Y1 (X1 and Y1 excluded)");
  command->add_option_function<std::string>(
      "--size", [arguments](const std::string& text) { arguments->size = ParseSize(text); },
      "Size of the image, WIDTHxHEIGHT in pixels, or a part of the scene's, as in 50% (default: "
      "the scene's; for glTF 720 high, as wide as the camera says)");
  AddGltfOptions(command, &arguments->gltf);
  AddOutputOptions(command, &settings);
  AddTransportOptions(command, &settings);
  AddStereoOption(command, &arguments->settings);
}

void AddViewOptions(CLI::App* command, ViewArguments* view) {
  const OptionGroup group(command, kImageGroup);
  command->add_option("--view", view->view,
                      "View of the image in PNGs and terminals: sRGB (values clipped at 1), \"ACES "
                      "1.0 SDR\" or Raw, or a view of the --ocio config (default: the first)");
  command->add_option("--display", view->display,
                      "Display of the --ocio config for which they are made (default: the first)");
  command
      ->add_option("--ocio", view->config,
                   "OpenColorIO config that defines displays and views (default: Sheaf's own)")
      ->envname("OCIO");
  command
      ->add_option("--exposure", view->exposure,
                   "Exposure of the image in PNGs and terminals: stops, e.g. -9.5, or auto "
                   "(default: 0, and auto for glTF files with lights in candela and lux)")
      ->check(CheckExposure);
}

void AddImageOptions(CLI::App* command, JobArguments* arguments) {
  const OptionGroup group(command, kImageGroup);
  command->add_option("-o,--output", arguments->output,
                      "Image to write at the end: .exr or .png; #### is the frame number");
  AddPngOptions(command, arguments);
  AddViewOptions(command, &arguments->view);
  AddFormatOptions(command, &arguments->format);
  AddDenoiserOption(command, arguments);
  AddVerboseFlag(command, arguments);
}

void AddResumeOption(CLI::App* command, JobArguments* arguments) {
  const OptionGroup group(command, "Scene and samples");
  command
      ->add_option("--resume-from", arguments->resume_from,
                   "Continue from this EXR, which Sheaf delivered for the same scene with the same "
                   "settings: only the missing samples are rendered (--samples and errors include "
                   "those of the EXR)")
      ->check(IsFile());
}

void AddPartitionOptions(CLI::App* command, JobArguments* arguments) {
  const OptionGroup group(command, "Division of the work");
  command
      ->add_option("--tile-size", arguments->tile_size_px,
                   "Edge of a tile; changes no pixel, unless sampling is adaptive")
      ->check(InRange(8, kTileSizePxMax));
  command
      ->add_option("--cell-size", arguments->cell_size_px,
                   "With adaptive sampling: edge of the cells of a tile, each with its own number "
                   "of samples; divides the tile's edge into at most 8 cells (default: 4 in small "
                   "frames, more in larger ones)")
      ->check(InRange(1, kTileSizePxMax));
  command
      ->add_option("--pass-samples", arguments->pass_sample_count,
                   "Samples of one pass, a power of two; changes no pixel")
      ->check(CheckPowerOfTwo);
  command
      ->add_option("--lease-passes", arguments->lease_pass_count,
                   "Maximum number of passes of one lease, a power of two; changes no pixel")
      ->check(CheckPowerOfTwo);
  command
      ->add_option(
          "--page-volumes-from", arguments->paged_file_bytes_min,
          "Files of volumes of this size on are packed as sheaf pack does, unless a medium "
          "moves by their velocities, and workers fetch the pages that their tasks read "
          "(default 256M); changes no pixel")
      ->transform(AsBytes());
}

void AddPlacementOptions(CLI::App* command, JobArguments* arguments) {
  const OptionGroup group(command, "Shares and workers");
  const CLI::Validator label([](const std::string& text) { return WhyNoLabel(text); }, "");
  command
      ->add_option("--show", arguments->show,
                   "The show that the job is for: shows share the farm (default: default)")
      ->envname("SHEAF_SHOW")
      ->check(label)
      ->type_name("NAME");
  command
      ->add_option("--pool", arguments->pool,
                   "Only workers of this pool (sheaf-worker --pool; default: default)")
      ->check(label)
      ->type_name("NAME");
  command
      ->add_option("--require", arguments->required_tags,
                   "Only workers with this tag (sheaf-worker --tag); may be given several times")
      ->allow_extra_args(false)
      ->check(label)
      ->type_name("TAG");
  command
      ->add_option("--memory-min", arguments->memory_min_bytes,
                   "Only workers that give scenes this much memory, e.g. 16G. Without it, those "
                   "that have less than the scene is expected to need come last")
      ->transform(AsBytes());
}

void AddFramesOption(CLI::App* command, JobArguments* arguments) {
  const OptionGroup group(command, "Scene and samples");
  command->add_option(
      "--frames", arguments->frames,
      "Frames of a pattern such as shot.####.pbrt, or of a glTF scene: 1-24, 1-100x5 or "
      "1,4,9-12");
}

void AddJobOptions(CLI::App* command, JobArguments* arguments) {
  AddSettingsOptions(command, arguments);
  AddStopOptions(command, &arguments->stop);
  AddFramesOption(command, arguments);
  const OptionGroup group(command, kImageGroup);
  command->add_option(
      "-o,--output", arguments->output,
      "Image to write: .exr, or .png with an .exr beside it; #### is the frame number");
  AddPngOptions(command, arguments);
  AddViewOptions(command, &arguments->view);
  AddFormatOptions(command, &arguments->format);
  AddDenoiserOption(command, arguments);
  AddVerboseFlag(command, arguments);
  AddResumeOption(command, arguments);
  AddPartitionOptions(command, arguments);
}

}  // namespace sheaf::cli
