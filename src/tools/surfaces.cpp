#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>

#include "commands.h"
#include "exit_status.h"
#include "inputs.h"
#include "option_checks.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/formatted.h"
#include "us_ct_registration/io/volumes/label_table.h"
#include "us_ct_registration/io/volumes/volume_io.h"
#include "us_ct_registration/rendering/surface_files.h"

namespace usct::tools {
namespace {

struct SurfacesCommand {
  std::string labels;
  std::string label_table;
  std::string ct;
  DicomReadOptions dicom;
  double hu = 200.0;
  std::string output;
  std::size_t triangles = 20000;
};

/// "kidney/left" becomes "kidney_left": a name that is safe as a part of a file's name.
std::string in_file_name(std::string name) {
  constexpr std::size_t kMostLetters = 60;
  std::replace_if(
      name.begin(), name.end(),
      [](char letter) {
        const bool is_plain = (letter >= 'a' && letter <= 'z') ||
                              (letter >= 'A' && letter <= 'Z') ||
                              (letter >= '0' && letter <= '9') || letter == '-' || letter == '.';
        return !is_plain;
      },
      '_');
  return name.substr(0, kMostLetters);
}

/// "case/ct.ply" of label 2, "tumour", is "case/ct_2_tumour.ply". The number keeps names apart that
/// are the same once they are safe.
std::filesystem::path file_of_label(const std::filesystem::path& output, int label,
                                    const LabelTable& table) {
  std::filesystem::path path = output;
  path.replace_filename(output.stem().string() + "_" + in_file_name(label_text(label, table)) +
                        output.extension().string());
  return path;
}

void write(const Surface& surface, const std::string& name,
           const std::optional<std::array<float, 3>>& colour, const std::filesystem::path& path) {
  write_surface(surface, name, colour, path);
  std::printf("%s: %s, %zu triangles\n", path.c_str(), name.c_str(), surface.triangles.size());
}

void write_labels(const SurfacesCommand& command) {
  const LabelTable table =
      command.label_table.empty() ? LabelTable{} : read_label_table(command.label_table);
  const auto labels = read_volume<std::uint16_t>(command.labels);
  const auto surfaces = label_surfaces(labels, command.triangles);
  print_warnings(surface_warnings(labels, surfaces, command.triangles, table));
  if (surfaces.empty()) throw InputError(command.labels, "has no voxel with a label");
  for (const auto& [label, surface] : surfaces) {
    if (surface.triangles.empty()) continue;
    write(surface, label_text(label, table), label_colour(label, table),
          file_of_label(command.output, label, table));
  }
}

void write_ct(const SurfacesCommand& command) {
  const Surface surface =
      iso_surface(read_ct_with_warnings(command.ct, command.dicom), command.hu, command.triangles);
  if (surface.triangles.empty())
    throw InputError(
        "--hu", formatted("is %g, which no voxel of '%s' reaches", command.hu, command.ct.c_str()));
  write(surface, formatted("CT at %g HU", command.hu), std::nullopt, command.output);
}

int run_surfaces(const SurfacesCommand& command) {
  require_surface_extension(command.output);
  if (command.labels.empty() == command.ct.empty())
    throw InputError("--labels, --ct", "exactly one of them must be given");
  if (command.labels.empty())
    write_ct(command);
  else
    write_labels(command);
  return kDone;
}

}  // namespace

void add_surfaces_command(CLI::App& app, Run& run) {
  CLI::App* command = app.add_subcommand(
      "surfaces",
      "Writes the surface of each label of a label map, or the surface of a CT at a HU, as PLY or "
      "STL: closed triangle meshes in the CT's frame, LPS, mm, as ct_server publishes them.");
  auto options = std::make_shared<SurfacesCommand>();
  CLI::Option* labels =
      command->add_option("--labels", options->labels, "label map of a CT; one file per label");
  CLI::Option* ct =
      command
          ->add_option(
              "--ct", options->ct,
              "CT, in place of a label map: DICOM folder or file, NRRD, MetaImage or NIfTI")
          ->excludes(labels);
  all_need(ct, *add_dicom_options(*command, options->dicom));
  command
      ->add_option("--label-table", options->label_table,
                   "YAML file with names and colours of the labels")
      ->needs(labels);
  command->add_option("--hu", options->hu, "CT value of the surface, HU")
      ->needs(ct)
      ->check(within(-1023.0, 32767.0))
      ->capture_default_str();
  command
      ->add_option("--output", options->output,
                   "file to write, .ply (with colours of labels) or .stl; label 2, 'tumour', of "
                   "case/ct.ply is written to case/ct_2_tumour.ply")
      ->required();
  command->add_option("--triangles", options->triangles, "greatest number per surface")
      ->check(within(1000, 2000000))
      ->capture_default_str();
  command->callback([options, &run] { run = [options] { return run_surfaces(*options); }; });
}

}  // namespace usct::tools
