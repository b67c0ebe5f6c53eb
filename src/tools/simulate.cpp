#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "beam_options.h"
#include "commands.h"
#include "exit_status.h"
#include "inputs.h"
#include "progress_bar.h"
#include "simulation_pictures.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/io/atomic_file.h"
#include "us_ct_registration/io/results/transform_io.h"
#include "us_ct_registration/io/ultrasound/prescan_nrrd.h"
#include "us_ct_registration/io/volumes/volume_io.h"
#include "us_ct_registration/simulation/simulation.h"
#include "us_ct_registration/ultrasound/conditioning.h"

namespace usct::tools {
namespace {

struct SimulateCommand {
  std::string ct;
  std::string us;
  BeamCommandOptions ultrasound;
  std::string transform;
  std::string output;

  SimulationOptions simulation;
  std::vector<double> window_hu;
  std::vector<double> weights;
  FitOptions fit;

  ConditioningOptions conditioning;
  Normalisation fit_to = Normalisation::kNone;
  std::vector<double> depth_mm;
  bool no_auto_depth = false;
  bool use_all = false;

  int frame = -1;
  double pixel_mm = 0.4;
  bool quiet = false;
};

/// A result: values, and those of them that are written and drawn as 0 and 255.
struct Result {
  std::string name;
  std::string title;
  const std::vector<float>& values;
  double black;
  double white;

  std::uint8_t grey(std::size_t i) const {
    const double grey = 255.0 * (values[i] - black) / (white - black);
    return static_cast<std::uint8_t>(std::nearbyint(std::clamp(grey, 0.0, 255.0)));
  }
};

void complete(SimulateCommand& command) {
  if (!command.window_hu.empty())
    command.simulation.window = HuWindow{command.window_hu[0], command.window_hu[1]};
  if (!command.weights.empty())
    command.fit.fixed_weights =
        SimulationWeights{command.weights[0], command.weights[1], command.weights[2]};
  if (!command.depth_mm.empty()) {
    command.conditioning.depth.min_mm = command.depth_mm[0];
    command.conditioning.depth.max_mm = command.depth_mm[1];
  }
  command.conditioning.depth.automatic = !command.no_auto_depth;
  if (command.fit_to != Normalisation::kNone) command.conditioning.normalisation = command.fit_to;
  command.simulation.validate("--ct options");
  command.fit.validate("--weights");
  command.conditioning.validate("--us options");
}

void write_bytes(const std::vector<std::uint8_t>& bytes, const UltrasoundBeams& beams,
                 const std::filesystem::path& path) {
  if (beams.geometry) {
    write_prescan_nrrd({*beams.geometry, bytes, {}}, path);
    return;
  }
  const BeamGrid& along = beams.along.beams;
  UsVolume volume(*beams.grid);
  std::size_t i = 0;
  for (int frame = 0; frame < along.frames; ++frame)
    for (int line = 0; line < along.lines; ++line)
      for (int sample = 0; sample < along.samples(); ++sample) {
        const Eigen::Vector3d index =
            beams.grid->index_from_physical(along.point(frame, line, sample));
        volume.at(static_cast<int>(std::lround(index.x())),
                  static_cast<int>(std::lround(index.y())),
                  static_cast<int>(std::lround(index.z()))) = bytes[i++];
      }
  write_volume(volume, path);
}

void write_images(const std::vector<Result>& results, const UltrasoundBeams& beams,
                  const std::filesystem::path& folder) {
  for (const Result& result : results) {
    std::vector<std::uint8_t> bytes(result.values.size());
    for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] = result.grey(i);
    write_bytes(bytes, beams, folder / (result.name + ".nrrd"));
  }
}

/// The ultrasound with what does not count in a colour per reason.
BeamImage exclusion_image(const BeamUltrasound& us, const std::vector<std::uint8_t>& reasons) {
  const auto colour = [&us, &reasons](std::size_t i) -> Picture::Colour {
    const double grey = us.brightness[i];
    const auto tinted = [&](double r, double g, double b) {
      return Picture::Colour((0.5 * Eigen::Array3d(r, g, b) + 0.5 * grey).cast<std::uint8_t>());
    };
    if (reasons[i] == 0) return Picture::Colour::Constant(static_cast<std::uint8_t>(grey));
    if ((reasons[i] & kUnknown) != 0) return {12, 16, 40};
    if ((reasons[i] & kOutsideDepth) != 0) return tinted(60, 60, 255);
    if ((reasons[i] & kFarWall) != 0) return tinted(0, 220, 220);
    if ((reasons[i] & kNoContact) != 0) return tinted(255, 0, 255);
    if ((reasons[i] & kShadow) != 0) return tinted(255, 60, 60);
    return tinted(255, 255, 0);
  };
  return {"not counting, by reason", colour};
}

/// Rows as in thesis figure 4.3, and one for what the conditioning did.
void write_pictures(const std::vector<Result>& results, const UltrasoundBeams& beams,
                    const ConditionedUltrasound& conditioned, const SimulateCommand& command) {
  const int frames = beams.along.beams.frames;
  const int frame = command.frame < 0 ? frames / 2 : command.frame;
  std::vector<BeamImage> images;
  images.reserve(results.size() + 1);
  for (const Result& result : results)
    images.push_back({result.title, [&result](std::size_t i) -> Picture::Colour {
                        return Picture::Colour::Constant(result.grey(i));
                      }});
  images.push_back(exclusion_image(beams.along, conditioned.reasons));
  constexpr std::size_t kColumns = 3;
  const auto sheet = [&](const auto& draw) {
    std::vector<std::vector<Picture>> rows;
    for (std::size_t i = 0; i < images.size(); ++i) {
      if (i % kColumns == 0) rows.emplace_back();
      rows.back().push_back(draw(images[i]));
    }
    return tile(rows);
  };
  const std::filesystem::path folder = command.output;
  write_png(sheet([&](const BeamImage& image) {
              return beam_picture(image, beams.along.beams, frame, command.pixel_mm);
            }),
            folder / "frame_beams.png");
  if (beams.geometry)
    write_png(sheet([&](const BeamImage& image) {
                return fan_picture(image, *beams.geometry, frame, command.pixel_mm);
              }),
              folder / "frame.png");
}

nlohmann::ordered_json exclusions(const ConditionedUltrasound& us) {
  nlohmann::ordered_json json;
  for (const ExclusionReason reason :
       {kUnknown, kOutsideDepth, kFarWall, kNoContact, kSaturated, kShadow, kConstant})
    json[to_string(reason)] =
        std::count_if(us.reasons.begin(), us.reasons.end(),
                      [&](std::uint8_t reasons) { return (reasons & reason) != 0; });
  return json;
}

nlohmann::ordered_json summary(const SimulatedUltrasound& simulated,
                               const ConditionedUltrasound& conditioned, int frame) {
  nlohmann::ordered_json json;
  json["status"] = to_string(simulated.status);
  json["message"] = simulated.message;
  json["weight_mapped_ct"] = simulated.weights.mapped_ct;
  json["weight_reflection"] = simulated.weights.reflection;
  json["bias"] = simulated.weights.bias;
  json["occluded_mean"] = simulated.occluded_mean;
  json["lc2"] = simulated.lc2;
  json["overlap"] = simulated.overlap;
  json["samples"] = conditioned.reasons.size();
  json["samples_used"] = simulated.used;
  json["samples_occluded"] = simulated.occluded;
  json["samples_excluded"] = exclusions(conditioned);
  json["min_depth_mm"] = conditioned.min_depth_mm;
  json["max_depth_mm"] = conditioned.max_depth_mm;
  json["far_wall_share"] = conditioned.far_wall_share;
  json["frame"] = frame;
  return json;
}

void write_json(const nlohmann::ordered_json& json, const std::filesystem::path& path) {
  write_atomically(path, [&](const std::filesystem::path& temporary) {
    std::ofstream file(temporary);
    file << json.dump(2) << '\n';
    if (!file) throw std::runtime_error("cannot write " + temporary.string());
  });
}

std::vector<Result> listed(const BeamUltrasound& us, const ConditionedUltrasound& conditioned,
                           const SimulatedComponents& components,
                           const SimulatedUltrasound& simulated, Normalisation fit_to) {
  const double span = fit_to == Normalisation::kNone ? 0.0 : 3.0;
  std::vector<Result> results{{"ultrasound", "A ultrasound", us.brightness, 0.0, 255.0},
                              {"ct", "B CT along the beams", components.ct_hu, -160.0, 340.0},
                              {"reflection", "C reflection r", components.reflection, 0.0, 1.0},
                              {"intensity", "D intensity I", components.intensity, 0.0, 1.0},
                              {"mapped_ct", "mapped CT p", components.mapped_ct, 0.0, 255.0}};
  if (simulated.has_fit())
    results.push_back({"simulated", "E simulated ultrasound", simulated.brightness,
                       span > 0.0 ? -span : 0.0, span > 0.0 ? span : 255.0});
  results.push_back(
      {"gradient", "gradient, 0-100 HU/mm", components.gradient_hu_per_mm, 0.0, 100.0});
  results.push_back({"conditioned", "conditioned ultrasound", conditioned.samples, -3.0, 3.0});
  return results;
}

/// What does not count: by the conditioning, or with --use-all only what is unknown.
std::vector<std::uint8_t> excluded(const SimulateCommand& command,
                                   const ConditionedUltrasound& conditioned) {
  std::vector<std::uint8_t> result = conditioned.reasons;
  if (command.use_all)
    for (std::uint8_t& reasons : result) reasons &= kUnknown;
  return result;
}

void make_folder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directory(folder, error);
  if (!std::filesystem::is_directory(folder))
    throw InputError("--output", "'" + folder.string() + "' cannot be made: " + error.message());
}

void print(const SimulatedUltrasound& simulated, const ConditionedUltrasound& conditioned,
           const std::string& folder) {
  std::printf("%s\n", folder.c_str());
  std::printf("status: %s\n", to_string(simulated.status).c_str());
  if (!simulated.has_fit()) {
    std::printf("why: %s\n", simulated.message.c_str());
    return;
  }
  std::printf("weights: mapped CT %.4g, reflection %.4g, bias %.4g\n", simulated.weights.mapped_ct,
              simulated.weights.reflection, simulated.weights.bias);
  std::printf("LC2: %.4f over %zu of %zu samples (%zu occluded), overlap %.3f\n", simulated.lc2,
              simulated.used, conditioned.reasons.size(), simulated.occluded, simulated.overlap);
  std::printf("depth_mm: %.1f %.1f, far wall on %.0f %% of the beams\n", conditioned.min_depth_mm,
              conditioned.max_depth_mm, 100.0 * conditioned.far_wall_share);
}

int run_simulate(SimulateCommand command) {
  complete(command);
  const UltrasoundBeams beams =
      command.ultrasound.beams(command.ultrasound.read(command.us), command.quiet);
  const int frames = beams.along.beams.frames;
  if (command.frame >= frames)
    throw InputError("--frame", "is " + std::to_string(command.frame) + ", must be < " +
                                    std::to_string(frames) + " (frames)");
  if (command.frame < 0) command.frame = frames / 2;
  const CtVolume ct = read_ct_with_warnings(command.ct);
  const Eigen::Isometry3d T_us_ct =
      command.transform.empty() ? Eigen::Isometry3d::Identity() : read_T_us_ct(command.transform);
  make_folder(command.output);
  const ConditionedUltrasound conditioned = condition(beams.along, command.conditioning);
  const SimulatedComponents components =
      simulate_components(beams.along.beams, ct, T_us_ct.inverse(), command.simulation,
                          progress_bar("simulation", command.quiet));
  const SimulatedUltrasound simulated = fit_to_ultrasound(
      components,
      command.fit_to == Normalisation::kNone ? beams.along.brightness : conditioned.samples,
      excluded(command, conditioned), command.fit);

  const std::filesystem::path folder = command.output;
  const std::vector<Result> results =
      listed(beams.along, conditioned, components, simulated, command.fit_to);
  write_images(results, beams, folder);
  write_bytes(components.flags, beams, folder / "flags.nrrd");
  write_bytes(conditioned.reasons, beams, folder / "excluded.nrrd");
  write_pictures(results, beams, conditioned, command);
  nlohmann::ordered_json json = summary(simulated, conditioned, command.frame);
  for (const Result& result : results)
    json["images"][result.name] = {{"black", result.black}, {"white", result.white}};
  write_json(json, folder / "simulation.json");
  print(simulated, conditioned, command.output);
  return simulated.has_fit() ? kDone : kRefused;
}

void add_simulation_options(CLI::App& app, SimulateCommand& command) {
  CLI::App* group = app.add_option_group("Simulation (equations of the thesis)");
  SimulationOptions& o = command.simulation;
  group->add_flag_callback(
      "--nearest", [&o] { o.interpolation = Interpolation::kNearest; },
      "nearest CT voxel instead of trilinear");
  group->add_option("--outside-hu", o.outside_hu, "what the CT does not show, HU")
      ->capture_default_str();
  group->add_option("--window", command.window_hu, "limits of the CT values simulated from, HU")
      ->expected(2);
  group
      ->add_option("--gradient-length", o.gradient_length_mm,
                   "eqs 4.3, 4.4: the gradient is a change of CT value over this length, mm")
      ->capture_default_str();
  group->add_option("--transmission-length", o.transmission_length_mm,
                    "eq 4.6: one factor t per this path, mm [per sample]");
  group->add_flag("--occlusion", o.occlusion.by_threshold,
                  "bone and gas reflect everything (patients)");
  group->add_option("--bone-hu", o.occlusion.bone_hu, "bone from here, HU")->capture_default_str();
  group->add_option("--gas-hu", o.occlusion.gas_hu, "gas below, HU")->capture_default_str();
  group
      ->add_option("--log-compression", o.log_compression,
                   "eq 4.7 of the reflection, or of the intensity as printed")
      ->transform(CLI::CheckedTransformer(std::map<std::string, LogCompression>{
          {"reflection", LogCompression::kReflection}, {"intensity", LogCompression::kIntensity}}));
  group->add_option("--log-a", o.log_a, "a of eq 4.7")->capture_default_str();
  group->add_option("--reflection-scale", o.reflection_scale, "factor on r before eq 4.7")
      ->capture_default_str();
  group->add_flag("--signed", o.signed_reflection, "keep the sign of the reflection");
  group->add_option("--slope", o.map.slope, "eq 4.8")->capture_default_str();
  group->add_option("--offset", o.map.offset, "eq 4.8")->capture_default_str();
  group->add_flag_callback(
      "--no-clamp", [&o] { o.map.clamp = false; }, "do not limit p to [0, 255]");
  group
      ->add_option("--weights", command.weights,
                   "of mapped CT and reflection, and bias (eq 4.9: alpha, beta, gamma); least "
                   "squares if not given")
      ->expected(3);
}

void add_conditioning_options(CLI::App& app, SimulateCommand& command) {
  CLI::App* group = app.add_option_group("Conditioning of the ultrasound");
  ConditioningOptions& o = command.conditioning;
  group->add_option("--fit-to", command.fit_to, "what the simulation is fitted to")
      ->transform(CLI::CheckedTransformer(
          std::map<std::string, Normalisation>{{"brightness", Normalisation::kNone},
                                               {"flattened", Normalisation::kFlatten},
                                               {"z-score", Normalisation::kZScore}}));
  group->add_option("--depth", command.depth_mm, "depths that count, mm [found]")->expected(2);
  group->add_flag("--no-auto-depth", command.no_auto_depth, "all depths count unless --depth says");
  group->add_flag("--use-all", command.use_all,
                  "near field, shadows and all else that is left out counts as well (the thesis)");
  group->add_option("--smoothing", o.smoothing_mm, "Gaussian against speckle, mm")
      ->capture_default_str();
  group->add_option("--normalisation-window", o.window_mm, "Gaussian of the local mean, mm")
      ->capture_default_str();
}

}  // namespace

void add_simulate_command(CLI::App& app, Run& run) {
  CLI::App* sub = app.add_subcommand(
      "simulate",
      "Simulates ultrasound from CT along the beams of an acquisition, fits it to the ultrasound, "
      "and writes every intermediate image: NRRD as the ultrasound is (simulation.json says which "
      "values are 0 and 255), and one frame as pictures, along the beams and scan-converted. CT in "
      "LPS mm, ultrasound in the US frame, mm. Exit status 3 if nothing could be fitted.");
  auto command = std::make_shared<SimulateCommand>();
  sub->add_option("--ct", command->ct, "DICOM folder or file, NRRD, MetaImage or NIfTI")
      ->required();
  sub->add_option("--us", command->us, "ultrasound of any kind that 'usct info' knows")->required();
  sub->add_option("--transform", command->transform,
                  "ITK transform from US to CT points, mm, LPS (identity if not given)");
  sub->add_option("--output", command->output, "folder to write, made if absent")->required();
  sub->add_option("--frame", command->frame, "frame to draw [the middle one]")
      ->check(CLI::NonNegativeNumber);
  sub->add_option("--pixel", command->pixel_mm, "size of a pixel of the pictures, mm")
      ->check(CLI::Range(0.05, 10.0))
      ->capture_default_str();
  add_simulation_options(*sub, *command);
  add_conditioning_options(*sub, *command);
  command->ultrasound.add_to(*sub);
  sub->add_flag("--quiet", command->quiet, "no progress on standard error");
  sub->callback([command, &run] { run = [command] { return run_simulate(*command); }; });
}

}  // namespace usct::tools
