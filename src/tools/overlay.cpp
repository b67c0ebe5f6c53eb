#include "us_ct_registration/rendering/overlay.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <memory>

#include "commands.h"
#include "exit_status.h"
#include "inputs.h"
#include "option_checks.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/formatted.h"
#include "us_ct_registration/io/camera_file.h"
#include "us_ct_registration/io/results/transform_io.h"
#include "us_ct_registration/io/volumes/label_table.h"
#include "us_ct_registration/io/volumes/volume_io.h"

namespace usct::tools {
namespace {

struct OverlayCommand {
  std::string labels;
  std::string names;
  std::string camera;
  std::string pose;
  std::string image;
  std::string output;
  std::vector<std::string> bands;
  double bound_mm = 3.0;
  double opacity = 0.25;
  std::size_t triangles = 20000;
  OverlayOptions drawing;
};

/// The size of the camera's image, darker towards its corners.
Picture empty_image(const CameraIntrinsics& camera) {
  const Eigen::Vector3d centre_colour(150.0, 95.0, 80.0);
  Picture picture(camera.width, camera.height);
  for (int y = 0; y < picture.height; ++y)
    for (int x = 0; x < picture.width; ++x) {
      const double from_centre =
          std::hypot(2.0 * x / picture.width - 1.0, 2.0 * y / picture.height - 1.0);
      for (int channel = 0; channel < 3; ++channel)
        picture.pixel(x, y)[channel] =
            static_cast<std::uint8_t>(centre_colour[channel] / (1.0 + from_centre * from_centre));
    }
  return picture;
}

Picture background(const OverlayCommand& command, const CameraIntrinsics& camera) {
  if (command.image.empty()) return empty_image(camera);
  Picture picture = read_png(command.image);
  if (picture.width != camera.width || picture.height != camera.height)
    throw InputError(command.image,
                     formatted("has %d x %d pixels, must have those of the camera in '%s', %d x %d",
                               picture.width, picture.height, command.camera.c_str(), camera.width,
                               camera.height));
  return picture;
}

std::vector<OverlayStructure> structures_of(const OverlayCommand& command) {
  const LabelTable table = command.names.empty() ? LabelTable{} : read_label_table(command.names);
  std::vector<OverlayStructure> structures;
  const auto labels = read_volume<std::uint16_t>(command.labels);
  const auto surfaces = label_surfaces(labels, command.triangles);
  print_warnings(surface_warnings(labels, surfaces, command.triangles, table));
  for (const auto& [label, surface] : surfaces) {
    OverlayStructure one;
    one.surface = std::make_shared<const Surface>(surface);
    const auto named = table.find(label);
    one.name = named == table.end() ? std::to_string(label) : named->second.name;
    const std::array<float, 3> colour = label_colour(label, table);
    for (int channel = 0; channel < 3; ++channel)
      one.colour[channel] = static_cast<std::uint8_t>(
          std::lround(255.0F * colour[static_cast<std::size_t>(channel)]));
    one.opacity = command.opacity;
    structures.push_back(std::move(one));
  }
  if (structures.empty()) throw InputError(command.labels, "has no voxel with a label");
  for (const std::string& band : command.bands) {
    const auto found = std::find_if(structures.begin(), structures.end(),
                                    [&](const OverlayStructure& one) { return one.name == band; });
    if (found == structures.end())
      throw InputError("--band", "is '" + band + "', which '" + command.labels + "' does not have");
    found->bound_mm = command.bound_mm;
  }
  return structures;
}

int run_overlay(const OverlayCommand& command) {
  const Camera camera = read_camera(command.camera);
  Picture picture = background(command, camera.intrinsics());
  const std::vector<OverlayStructure> structures = structures_of(command);
  const OverlayCoverage coverage =
      OverlayRenderer(command.drawing)
          .draw(view_of(picture), camera, read_T_us_ct(command.pose), structures);
  for (std::size_t i = 0; i < structures.size(); ++i) {
    draw_line(view_of(picture), structures[i].name,
              static_cast<int>(i) - static_cast<int>(structures.size()), structures[i].colour);
    std::printf("%s: %zu triangles, %zu pixels\n", structures[i].name.c_str(),
                structures[i].surface->triangles.size(), coverage[i]);
  }
  if (std::all_of(coverage.begin(), coverage.end(), [](std::size_t n) { return n == 0; }))
    print_warnings(
        {"no structure of '" + command.labels + "' lies in the picture by '" + command.pose + "'"});
  write_png(picture, command.output);
  std::printf("%s\n", command.output.c_str());
  return kDone;
}

}  // namespace

void add_overlay_command(CLI::App& app, Run& run) {
  CLI::App* command = app.add_subcommand(
      "overlay",
      "Draws the surfaces of a label map of the CT into an image of a calibrated camera, as the "
      "node video_overlay does.");
  auto options = std::make_shared<OverlayCommand>();
  command->add_option("--labels", options->labels, "label map of the CT")->required();
  command->add_option("--names", options->names, "YAML file with names and colours of the labels");
  command
      ->add_option("--camera", options->camera,
                   "YAML file of the camera, as ROS' camera_calibration writes it")
      ->required();
  command
      ->add_option("--pose", options->pose,
                   "ITK transform from points of the camera's optical frame (z forward, x right, "
                   "y down) to CT points, mm, LPS")
      ->required();
  command->add_option("--image", options->image, "picture of the camera, .png [a plain one]");
  command->add_option("--output", options->output, "picture to write, .png")->required();
  CLI::Option* band = command->add_option(
      "--band", options->bands,
      "name of a structure that gets an uncertainty band; several times for more");
  command->add_option("--bound", options->bound_mm, "radius of the band, mm")
      ->needs(band)
      ->check(within(0.0, 1000.0))
      ->capture_default_str();
  command->add_option("--opacity", options->opacity, "opacity of the fill")
      ->check(within(0.0, 1.0))
      ->capture_default_str();
  command->add_option("--triangles", options->triangles, "greatest number per surface")
      ->check(within(1000, 2000000))
      ->capture_default_str();
  command->callback([options, &run] { run = [options] { return run_overlay(*options); }; });
}

}  // namespace usct::tools
