#include "simulation_files.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "simulation_pictures.h"
#include "us_ct_registration/io/atomic_file.h"
#include "us_ct_registration/io/ultrasound/prescan_nrrd.h"
#include "us_ct_registration/io/volumes/volume_io.h"

namespace usct::tools {
namespace {

/// An image of one value per sample of the ultrasound, and the values that are written and drawn as
/// 0 and 255. The values must outlive this object.
struct SimulationImage {
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

void write_images(const std::vector<SimulationImage>& images, const UltrasoundBeams& beams,
                  const std::filesystem::path& folder) {
  for (const SimulationImage& image : images) {
    std::vector<std::uint8_t> bytes(image.values.size());
    for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] = image.grey(i);
    write_bytes(bytes, beams, folder / (image.name + ".nrrd"));
  }
}

/// The ultrasound, in which excluded samples have a colour per reason.
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

/// Draws the images in rows as in thesis figure 4.3, and last the exclusions.
void write_pictures(const std::vector<SimulationImage>& images, const Simulation& simulation,
                    int frame, double pixel_mm, const std::filesystem::path& folder) {
  const UltrasoundBeams& beams = simulation.beams;
  std::vector<BeamImage> drawn;
  drawn.reserve(images.size() + 1);
  for (const SimulationImage& image : images)
    drawn.push_back({image.title, [&image](std::size_t i) -> Picture::Colour {
                       return Picture::Colour::Constant(image.grey(i));
                     }});
  drawn.push_back(exclusion_image(beams.along, simulation.conditioned.reasons));
  constexpr std::size_t kColumns = 3;
  const auto sheet = [&](const auto& draw) {
    std::vector<std::vector<Picture>> rows;
    for (std::size_t i = 0; i < drawn.size(); ++i) {
      if (i % kColumns == 0) rows.emplace_back();
      rows.back().push_back(draw(drawn[i]));
    }
    return tile(rows);
  };
  write_png(sheet([&](const BeamImage& image) {
              return beam_picture(image, beams.along.beams, frame, pixel_mm);
            }),
            folder / "frame_beams.png");
  if (beams.geometry)
    write_png(sheet([&](const BeamImage& image) {
                return fan_picture(image, *beams.geometry, frame, pixel_mm);
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
  write_text(path, json.dump(2) + '\n');
}

/// The values of p that are 0 and 255: grey values, or the range that p has without the limit.
std::pair<double, double> range_of_mapped_ct(const Simulation& simulation) {
  if (simulation.options.map.clamp) return {0.0, 255.0};
  const std::vector<float>& mapped = simulation.components.mapped_ct;
  const auto [least, greatest] = std::minmax_element(mapped.begin(), mapped.end());
  return {*least, *greatest > *least ? *greatest : *least + 1.0};
}

std::vector<SimulationImage> images_of(const Simulation& simulation) {
  const std::vector<float>& brightness = simulation.beams.along.brightness;
  const SimulatedComponents& components = simulation.components;
  const double span = simulation.fit_to == Normalisation::kNone ? 0.0 : 3.0;
  const double least_reflection = simulation.options.signed_reflection ? -1.0 : 0.0;
  const auto [mapped_black, mapped_white] = range_of_mapped_ct(simulation);
  std::vector<SimulationImage> images{
      {"ultrasound", "A ultrasound", brightness, 0.0, 255.0},
      {"ct", "B CT along the beams", components.ct_hu, -160.0, 340.0},
      {"reflection", "C reflection r", components.reflection, least_reflection, 1.0},
      {"intensity", "D intensity I", components.intensity, 0.0, 1.0},
      {"mapped_ct", "mapped CT p", components.mapped_ct, mapped_black, mapped_white}};
  if (simulation.simulated.has_fit())
    images.push_back({"simulated", "E simulated ultrasound", simulation.simulated.brightness,
                      span > 0.0 ? -span : 0.0, span > 0.0 ? span : 255.0});
  images.push_back(
      {"gradient", "gradient, 0-100 HU/mm", components.gradient_hu_per_mm, 0.0, 100.0});
  images.push_back(
      {"conditioned", "conditioned ultrasound", simulation.conditioned.samples, -3.0, 3.0});
  return images;
}

}  // namespace

void write_simulation(const Simulation& simulation, int frame, double pixel_mm,
                      const std::filesystem::path& folder) {
  const std::vector<SimulationImage> images = images_of(simulation);
  write_images(images, simulation.beams, folder);
  write_bytes(simulation.components.flags, simulation.beams, folder / "flags.nrrd");
  write_bytes(simulation.conditioned.reasons, simulation.beams, folder / "excluded.nrrd");
  write_pictures(images, simulation, frame, pixel_mm, folder);
  nlohmann::ordered_json json = summary(simulation.simulated, simulation.conditioned, frame);
  for (const SimulationImage& image : images)
    json["images"][image.name] = {{"black", image.black}, {"white", image.white}};
  write_json(json, folder / "simulation.json");
}

}  // namespace usct::tools
