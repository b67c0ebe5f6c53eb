#include "study_pictures.h"

#include <algorithm>
#include <map>

#include "us_ct_registration/io/ultrasound/ultrasound_source.h"
#include "us_ct_registration/rendering/plot.h"
#include "us_ct_registration/rendering/registration_pictures.h"

namespace usct::tools {
namespace {

constexpr double kPictureSpacingMm = 0.5;
constexpr double kMaxErrorMm = 10.0;

using Runs = std::vector<const StudyRun*>;

std::map<std::string, Runs> by_group(const std::vector<StudyRun>& runs) {
  std::map<std::string, Runs> groups;
  for (const StudyRun& run : runs) groups[run.group].push_back(&run);
  return groups;
}

/// Accepted without truth is worst of all; then large errors; refusals last.
double badness(const StudyRun& run) {
  if (!run.accepted()) return -1.0;
  return run.after ? run.after->mean_mm : 1e9;
}

/// Rises by 1 / runs at each error; refused runs never come.
PlotSeries error_cdf(const std::string& name, const Runs& runs) {
  std::vector<double> errors_mm;
  for (const StudyRun* run : runs)
    if (run->after) errors_mm.push_back(run->after->mean_mm);
  std::sort(errors_mm.begin(), errors_mm.end());
  PlotSeries series{name, {{0.0, 0.0}}, true};
  double share = 0.0;
  for (const double error_mm : errors_mm) {
    if (error_mm > kMaxErrorMm) break;
    series.points.emplace_back(error_mm, share);
    share += 100.0 / static_cast<double>(runs.size());
    series.points.emplace_back(error_mm, share);
  }
  series.points.emplace_back(kMaxErrorMm, share);
  return series;
}

void write_plots(const std::map<std::string, Runs>& groups, const std::filesystem::path& folder) {
  std::vector<PlotSeries> cdfs;
  std::vector<PlotSeries> scatter;
  bool any_expected = false;
  for (const auto& [name, runs] : groups) {
    cdfs.push_back(error_cdf(name, runs));
    PlotSeries dots{name, {}, false};
    for (const StudyRun* run : runs)
      if (run->expected && run->after)
        dots.points.emplace_back(run->expected->rms_mm, run->after->rms_mm);
    any_expected = any_expected || !dots.points.empty();
    scatter.push_back(dots);
  }
  write_png(plot({"mean TRE (mm)", "runs with a TRE up to this (%)", kMaxErrorMm, 100.0}, cdfs),
            folder / "tre_cdf.png");
  if (!any_expected) return;
  scatter.push_back({"true = expected", {{0.0, 0.0}, {kMaxErrorMm, kMaxErrorMm}}, true});
  scatter.push_back({"true = 2 x expected", {{0.0, 0.0}, {0.5 * kMaxErrorMm, kMaxErrorMm}}, true});
  write_png(plot({"expected RMS TRE (mm)", "true RMS TRE (mm)", kMaxErrorMm, kMaxErrorMm}, scatter),
            folder / "calibration.png");
}

void write_pictures_of(const std::vector<StudyCase>& cases, const StudyRun& run,
                       const std::filesystem::path& folder) {
  const Ultrasound ultrasound = trial_ultrasound(cases, run.trial);
  RegistrationPictureOptions options;
  options.axes_us = picture_axes(ultrasound);
  Eigen::Vector3d centre_mm = Eigen::Vector3d::Zero();
  const auto& targets = cases[run.trial.us_case].targets_us_mm;
  for (const Eigen::Vector3d& p : targets) centre_mm += p / static_cast<double>(targets.size());
  options.centre_us_mm = centre_mm;
  CompoundOptions compounding;
  compounding.hole_fill_radius_mm = 2.0;
  write_registration_pictures(in_space(ultrasound, kPictureSpacingMm, compounding),
                              cases[run.trial.ct_case].ct, run.trial.T_us_ct_initial, run.result,
                              folder, options);
}

}  // namespace

void write_study_pictures(const std::vector<StudyCase>& cases, const std::vector<StudyRun>& runs,
                          const std::filesystem::path& folder) {
  std::filesystem::create_directories(folder);
  const std::map<std::string, Runs> groups = by_group(runs);
  write_plots(groups, folder);
  for (const auto& [name, of_group] : groups) {
    const StudyRun* worst = *std::max_element(
        of_group.begin(), of_group.end(),
        [](const StudyRun* a, const StudyRun* b) { return badness(*a) < badness(*b); });
    write_pictures_of(cases, *worst, folder / ("worst_" + name));
  }
}

}  // namespace usct::tools
