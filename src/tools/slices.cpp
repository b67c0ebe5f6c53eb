#include "us_ct_registration/rendering/slices.h"

#include <array>
#include <cstdio>
#include <filesystem>
#include <numeric>
#include <optional>

#include "commands.h"
#include "exit_status.h"
#include "inputs.h"
#include "option_checks.h"
#include "progress_bar.h"
#include "ultrasound_options.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/io/results/points_io.h"
#include "us_ct_registration/io/results/result_io.h"
#include "us_ct_registration/io/results/transform_io.h"
#include "us_ct_registration/rendering/result_marks.h"
#include "us_ct_registration/volume/sampling.h"

namespace usct::tools {
namespace {

struct SlicesOptions {
  std::string us;
  UltrasoundOptions ultrasound;
  std::string ct;
  DicomReadOptions dicom;
  std::string transform;
  std::string result;
  std::string output;
  std::vector<double> at_mm;
  std::string points;
  double pixel_mm = 0.4;
  std::vector<double> window_hu{CtWindow{}.low_hu, CtWindow{}.high_hu};
  bool quiet = false;
};

constexpr double kPointDistanceMm = 1.0;
const Picture::Colour kPointColour(255, 60, 60);

/// Whether the CT lies in a part of the plane.
bool shows(const SlicePlane& plane, const CtVolume& ct, const Eigen::Isometry3d& T_us_ct) {
  const Eigen::Isometry3d T_ct_us = T_us_ct.inverse();
  for (int y = 0; y < plane.height; ++y)
    for (int x = 0; x < plane.width; ++x)
      if (contains_index(ct.grid, ct.grid.index_from_physical(T_ct_us * plane.point_mm(x, y))))
        return true;
  return false;
}

Eigen::Vector3d centre(const SlicesOptions& options, const Grid& grid,
                       const std::vector<Eigen::Vector3d>& points_us_mm) {
  if (!options.at_mm.empty()) return {options.at_mm[0], options.at_mm[1], options.at_mm[2]};
  if (points_us_mm.empty()) return grid.centre_mm();
  const Eigen::Vector3d sum =
      std::accumulate(points_us_mm.begin(), points_us_mm.end(), Eigen::Vector3d(0, 0, 0));
  return sum / static_cast<double>(points_us_mm.size());
}

/// Throws InputError if the CT lies in none of the planes, so that all of its pictures would be
/// empty; warns if it lies in some only.
void require_ct_in_planes(const SlicesOptions& options, const CtVolume& ct,
                          const Eigen::Isometry3d& T_us_ct,
                          const std::array<SlicePlane, 3>& planes) {
  const std::string pose = !options.transform.empty() ? "by '" + options.transform + "'"
                           : !options.result.empty()  ? "by '" + options.result + "'"
                                                      : "without --transform or --result";
  std::string without_ct;
  std::size_t count = 0;
  for (const SlicePlane& plane : planes) {
    if (shows(plane, ct, T_us_ct)) continue;
    ++count;
    without_ct += (without_ct.empty() ? "" : ", ") + plane.name;
  }
  if (count == planes.size())
    throw InputError(options.ct, "lies in none of the planes to draw " + pose +
                                     ", must lie in one: check the pose, its direction (from US "
                                     "to CT points) and --at");
  if (count > 0)
    print_warnings({options.ct + ": does not lie in the planes " + without_ct + " " + pose});
}

/// One row of the figure: ultrasound, CT, both blended, and both as a checkerboard.
std::vector<Picture> row(const ScanConverted& us, const CtVolume& ct,
                         const Eigen::Isometry3d& T_us_ct, CtWindow window, const SlicePlane& plane,
                         const std::vector<Eigen::Vector3d>& points_us_mm) {
  const Picture ultrasound = render_us(us.volume, us.mask, plane);
  const Picture computed = render_ct(ct, T_us_ct, window, plane);
  std::vector<Picture> pictures{ultrasound, computed, blend(ultrasound, computed),
                                checkerboard(ultrasound, computed)};
  const char* kinds[] = {"US", "CT", "US blue, CT orange", "US and CT"};
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    draw_points(pictures[i], plane, points_us_mm, kPointDistanceMm, kPointColour);
    draw_text(pictures[i], plane.name + ": " + kinds[i], 6, 16);
  }
  return pictures;
}

/// The pose to draw, and the result that it is of, if there is one.
struct Pose {
  Eigen::Isometry3d T_us_ct = Eigen::Isometry3d::Identity();
  std::optional<RegistrationResult> result;
};

Pose pose_of(const SlicesOptions& options) {
  if (!options.transform.empty()) return {read_T_us_ct(options.transform), std::nullopt};
  if (options.result.empty()) return {};
  const RegistrationResult result = read_result(options.result);
  const std::optional<Eigen::Isometry3d> T_us_ct = drawn_pose(result);
  if (!T_us_ct)
    throw InputError("--result",
                     "'" + options.result +
                         "' has neither a transform nor a candidate to draw: " + result.message);
  return {*T_us_ct, result};
}

int run_slices(const SlicesOptions& options) {
  require_rising("--window", options.window_hu);
  const Pose pose = pose_of(options);
  const Ultrasound read = read_ultrasound_with_warnings(options.ultrasound.source(options.us));
  const ScanConverted us = in_space(read, options.pixel_mm, options.ultrasound.compounding(read),
                                    progress_bar("scan conversion", options.quiet));
  const CtVolume ct = read_ct_with_warnings(options.ct, options.dicom);
  std::vector<Eigen::Vector3d> points_us_mm;
  if (!options.points.empty()) points_us_mm = read_points_mm(options.points);

  const std::array<SlicePlane, 3> planes = orthogonal_planes(
      us.volume.grid, centre(options, us.volume.grid, points_us_mm), options.pixel_mm);
  require_ct_in_planes(options, ct, pose.T_us_ct, planes);
  std::vector<std::vector<Picture>> rows;
  for (const SlicePlane& plane : planes) {
    rows.push_back(row(us, ct, pose.T_us_ct, {options.window_hu[0], options.window_hu[1]}, plane,
                       points_us_mm));
    if (pose.result) mark_if_refused(rows.back(), *pose.result);
  }
  Picture sheet = tile(rows);
  if (pose.result) sheet = tile({{result_header(*pose.result, sheet.width)}, {sheet}});
  write_png(sheet, options.output);
  std::printf("%s\n", options.output.c_str());
  return kDone;
}

}  // namespace

void add_slices_command(CLI::App& app, Run& run) {
  CLI::App* command = app.add_subcommand(
      "slices",
      "Draws ultrasound and CT on three orthogonal planes of the US frame: ultrasound, CT, both "
      "blended, both as a checkerboard. Millimetres; x lateral, y axial (away from the probe), z "
      "elevation.");
  auto options = std::make_shared<SlicesOptions>();
  command->add_option("--us", options->us, "ultrasound of any kind that 'usct info' knows")
      ->required();
  command->add_option("--ct", options->ct, "DICOM folder or file, NRRD, MetaImage or NIfTI")
      ->required();
  add_dicom_options(*command, options->dicom);
  CLI::Option* transform =
      command->add_option("--transform", options->transform,
                          "ITK transform from US to CT points, mm, LPS (identity if not given: "
                          "the CT must then lie in the US frame)");
  command
      ->add_option("--result", options->result,
                   "result of a registration, .json, in place of a transform; that of a refused "
                   "one is drawn at its best candidate and marked as refused")
      ->excludes(transform);
  command->add_option("--output", options->output, "picture to write, .png")->required();
  CLI::Option* at = command->add_option("--at", options->at_mm,
                                        "point of the US frame that the planes meet in, mm");
  at->expected(3);
  command->add_option("--points", options->points,
                      "CSV x,y,z of points in the US frame (mm) to draw where they meet a plane; "
                      "the planes meet in their mean unless --at is given");
  command->add_option("--pixel", options->pixel_mm, "size of a pixel, mm")
      ->check(within(0.05, 10.0))
      ->capture_default_str();
  command->add_option("--window", options->window_hu, "HU drawn black and white")
      ->expected(2)
      ->capture_default_str();
  options->ultrasound.add_to(*command);
  options->ultrasound.add_compounding_to(*command);
  command->add_flag("--quiet", options->quiet, "no progress bar");
  command->callback([options, &run] { run = [options] { return run_slices(*options); }; });
}

}  // namespace usct::tools
