#include "us_ct_registration/evaluation/study.h"

#include <algorithm>
#include <list>
#include <mutex>
#include <set>

#include "evaluation/fingerprint.h"
#include "io/bytes.h"
#include "require.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/io/options/registration_options_io.h"
#include "us_ct_registration/registration/registration.h"
#include "us_ct_registration/ultrasound/ultrasound_beams.h"

namespace usct {
namespace {

namespace fs = std::filesystem;

/// To be raised with every change that makes runs differ from those of the same version before.
constexpr std::uint64_t kRunFormat = 1;

StudyCase read_case(const Study& study, std::size_t index) {
  return index < study.cases.size() ? read_study_case(study.cases[index])
                                    : read_stranger(study.strangers[index - study.cases.size()]);
}

void add_file(Fingerprint& print, const fs::path& path) {
  if (!fs::exists(path)) return print.add("");
  const io::Bytes bytes = io::read_bytes(path);
  print.add(bytes);
}

void add_pose(Fingerprint& print, const Eigen::Isometry3d& T) {
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 4; ++column) print.add(T(row, column));
}

/// The fingerprint of what a case holds. That of its images covers all voxels, wherever the files
/// have them.
std::string fingerprint_of(const StudyCase& study_case, const fs::path& folder) {
  Fingerprint print;
  print.add(study_case.name);
  for (const char* name : {"us.nrrd", "truth.tfm", "targets.csv", "targets_ct.csv"})
    add_file(print, folder / name);
  const Grid& grid = study_case.ct.grid;
  for (int axis = 0; axis < 3; ++axis) {
    print.add(static_cast<std::uint64_t>(grid.size[axis]));
    print.add(grid.spacing_mm[axis]);
    print.add(grid.origin_mm[axis]);
    for (int row = 0; row < 3; ++row) print.add(grid.direction(row, axis));
  }
  print.add(study_case.ct.voxels);
  print.add(study_case.ultrasound.voxels);
  return print.text();
}

std::string fingerprint_of(const StudyMethod& method) {
  Fingerprint print;
  print.add(registration_options_yaml(method.options));
  print.add(method.parallel_beams_mm.value_or(0.0));
  return print.text();
}

void require_name(const std::string& name, const std::string& source) {
  const auto allowed = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
           std::string("_-.+").find(c) != std::string::npos;
  };
  if (name.empty() || name[0] == '.' || !std::all_of(name.begin(), name.end(), allowed))
    throw InputError(source,
                     "a method's name is '" + name +
                         "', must be of letters, digits, '_', '-', '.' and '+', and must not "
                         "begin with '.'");
}

/// Reads cases, and holds the last few of them, since the runs of a study are in the order of
/// cases.
class CaseReader {
 public:
  explicit CaseReader(Study study)
      : study_(std::move(study)), known_(study_.cases.size() + study_.strangers.size()) {}

  std::shared_ptr<const StudyCase> at(std::size_t index) {
    const std::lock_guard<std::mutex> lock(reading_);
    std::shared_ptr<const StudyCase> found = known_.at(index).lock();
    if (!found) known_[index] = found = std::make_shared<const StudyCase>(read_case(study_, index));
    held_.remove(found);
    held_.push_front(found);
    constexpr std::size_t kHeld = 4;
    if (held_.size() > kHeld) held_.pop_back();
    return found;
  }

 private:
  Study study_;
  std::mutex reading_;
  std::vector<std::weak_ptr<const StudyCase>> known_;
  std::list<std::shared_ptr<const StudyCase>> held_;
};

std::string fingerprint_of(const Study& study, const Trial& trial,
                           const std::vector<std::string>& of_cases, const std::string& of_method) {
  Fingerprint print;
  print.add(kRunFormat);
  print.add(USCT_VERSION);
  print.add(of_cases[trial.us_case]);
  print.add(of_cases[trial.ct_case]);
  print.add(of_method);
  print.add(static_cast<std::uint64_t>(trial.kind));
  print.add(static_cast<std::uint64_t>(trial.study_seed));
  print.add(static_cast<std::uint64_t>(trial.index));
  print.add(trial.seed);
  add_pose(print, trial.T_us_ct_initial);
  print.add(static_cast<std::uint64_t>(study.how));
  return print.text();
}

}  // namespace

Register registers_with(const StudyMethod& method) {
  BeamOptions beams;
  beams.parallel_beams_mm = method.parallel_beams_mm;
  return [options = method.options, beams](const PreScanVolume& ultrasound, const CtVolume& ct,
                                           const Eigen::Isometry3d& T_us_ct_initial) {
    return register_ultrasound(beams_of(ultrasound, beams).along, ct, T_us_ct_initial, options);
  };
}

void Study::validate(const std::string& source) const {
  starts.validate(source);
  require_positive(source, "success_mm", success_mm);
  if (methods.empty()) throw InputError(source, "'methods' is empty, must have at least 1");
  std::set<std::string> names;
  for (const StudyMethod& method : methods) {
    require_name(method.name, source);
    if (!names.insert(method.name).second)
      throw InputError(source, "two methods are named '" + method.name + "', names must differ");
    const std::string where = source + ": method '" + method.name + "'";
    method.options.validate(where);
    if (method.parallel_beams_mm)
      require_positive(where, "parallel_beams_mm", *method.parallel_beams_mm);
  }
}

StudyPlan plan_study(const Study& study) {
  study.validate();
  StudyPlan plan;
  plan.study = study;
  std::vector<std::string> of_cases;
  for (std::size_t i = 0; i < study.cases.size() + study.strangers.size(); ++i) {
    plan.cases.push_back(read_case(study, i));
    StudyCase& outline = plan.cases.back();
    of_cases.push_back(fingerprint_of(outline, i < study.cases.size()
                                                   ? study.cases[i]
                                                   : study.strangers[i - study.cases.size()]));
    outline.ct.voxels = {};
    outline.ultrasound.voxels = {};
  }
  std::vector<std::string> of_methods;
  for (const StudyMethod& method : study.methods) of_methods.push_back(fingerprint_of(method));
  const std::vector<Trial> trials = plan_trials(plan.cases, study.starts);
  for (auto begin = trials.begin(); begin != trials.end();) {
    const auto end = std::find_if(
        begin, trials.end(), [&](const Trial& trial) { return trial.us_case != begin->us_case; });
    for (std::size_t method = 0; method < study.methods.size(); ++method)
      for (auto trial = begin; trial != end; ++trial)
        plan.runs.push_back(
            {method, *trial, fingerprint_of(study, *trial, of_cases, of_methods[method])});
    begin = end;
  }
  return plan;
}

CaseSource case_reader(const Study& study) {
  const auto reader = std::make_shared<CaseReader>(study);
  return [reader](std::size_t index) { return reader->at(index); };
}

}  // namespace usct
