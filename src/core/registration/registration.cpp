#include "us_ct_registration/registration/registration.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>

#include "parallel.h"
#include "us_ct_registration/registration/pose_parameters.h"
#include "us_ct_registration/simulation/decimation.h"
#include "us_ct_registration/volume/operations.h"

namespace usct {
namespace {
using Eigen::Isometry3d;
using Eigen::Vector3d;
using Eigen::VectorXd;

struct Candidate {
  Isometry3d T_us_ct;
  AcquisitionErrors errors;
  double value = -1e9;
  double overlap = 0.0;
};

double now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

std::vector<Vector3d> corners(const BeamGrid& b) {
  std::vector<Vector3d> r;
  const int nf = std::min(b.frames, 5), nl = std::min(b.lines, 5);
  for (int f = 0; f < nf; ++f)
    for (int l = 0; l < nl; ++l)
      for (int s : {0, b.samples() - 1})
        r.push_back(b.point(nf > 1 ? f * (b.frames - 1) / (nf - 1) : 0,
                            nl > 1 ? l * (b.lines - 1) / (nl - 1) : 0, s));
  return r;
}

}  // namespace

RegistrationResult register_ultrasound(const BeamUltrasound& ultrasound, const CtVolume& ct,
                                       const Isometry3d& T_us_ct_initial,
                                       const RegistrationOptions& options,
                                       const RegistrationHooks& hooks) {
  (void)hooks;
  RegistrationResult result;
  double t0 = now();
  const BeamUltrasound fine =
      decimate(ultrasound, factors_for_spacing(ultrasound.beams, options.conditioning_spacing_mm));
  double t1 = now();
  result.seconds["decimate"] = t1 - t0;
  const ConditionedUltrasound conditioned = condition(fine, options.conditioning);
  BeamUltrasound us{fine.beams, conditioned.samples, {}};
  us.known.resize(us.brightness.size());
  for (std::size_t i = 0; i < us.known.size(); ++i) us.known[i] = conditioned.reasons[i] == 0;
  t0 = now();
  result.seconds["condition"] = t0 - t1;

  // Points that count
  std::vector<Vector3d> points;
  {
    std::size_t i = 0;
    const BeamGrid& b = us.beams;
    for (int f = 0; f < b.frames; ++f)
      for (int l = 0; l < b.lines; ++l)
        for (int s = 0; s < b.samples(); ++s, ++i)
          if (us.known[i] && i % 61 == 0) points.push_back(b.point(f, l, s));
  }
  const PoseParameters pose(T_us_ct_initial, points);
  double margin = 10.0;
  {
    const std::optional<StartOptions>& st = options.stages.front().starts;
    if (st) {
      double radius = 0;
      for (auto& p : points) radius = std::max(radius, (p - pose.centre_us_mm()).norm());
      margin += st->translation_mm + radius * std::min(1.2, st->rotation_rad);
    }
  }
  std::vector<Vector3d> reach;
  for (auto& p : corners(us.beams)) reach.push_back(T_us_ct_initial.inverse() * p);
  const Region region = region_around(ct.grid, reach, margin);
  if (region.size.minCoeff() < 2) {
    result.status = RegistrationStatus::kNoOverlap;
    return result;
  }
  // CT levels, finest first
  std::vector<Volume<float>> level_ct(options.stages.size());
  for (std::size_t i = options.stages.size(); i-- > 0;) {
    const double spacing = options.stages[i].spacing_mm;
    const bool finest = i + 1 == options.stages.size();
    const Grid& g = finest ? ct.grid : level_ct[i + 1].grid;
    const Region reg = finest ? region : whole(g);
    Eigen::Vector3i factors;
    for (int a = 0; a < 3; ++a)
      factors[a] =
          std::clamp(static_cast<int>(std::lround(spacing / g.spacing_mm[a])), 1, reg.size[a]);
    level_ct[i] = finest ? shrink(ct, factors, reg) : shrink(level_ct[i + 1], factors, reg);
  }
  t1 = now();
  result.seconds["ct"] = t1 - t0;

  std::vector<Candidate> candidates{{T_us_ct_initial, {}, 0, 0}};
  int evaluations = 0;
  for (std::size_t level = 0; level < options.stages.size(); ++level) {
    t0 = now();
    const StageOptions& stage = options.stages[level];
    const BeamUltrasound level_us = decimate(us, factors_for_spacing(us.beams, stage.spacing_mm));
    const auto patches = std::make_shared<const UltrasoundPatches>(
        cut_into_patches(level_us, stage.similarity.patches));
    const auto packed =
        std::make_shared<const PackedCt>(level_ct[level], options.window, options.outside_hu);
    const auto similarity = make_patch_similarity(patches, packed, stage.similarity);
    t1 = now();
    result.seconds["prepare" + std::to_string(level)] = t1 - t0;
    const auto value = [&](const Isometry3d& T, const AcquisitionErrors& e) {
      return similarity->evaluate(T.inverse(), e);
    };
    std::vector<Candidate> spread;
    if (stage.starts) {
      for (const Candidate& c : candidates) {
        const PoseParameters p(c.T_us_ct, points);
        for (const PoseVector& v : spread_starts(p, *stage.starts))
          spread.push_back({p.T_us_ct(v), c.errors, 0, 0});
      }
    } else {
      spread = candidates;
    }
    parallel_for(static_cast<int>((spread.size() + 15) / 16), [&](int b) {
      for (std::size_t i = static_cast<std::size_t>(b) * 16;
           i < std::min(spread.size(), static_cast<std::size_t>(b) * 16 + 16); ++i) {
        const SimilarityValue v = value(spread[i].T_us_ct, spread[i].errors);
        spread[i].value = std::isfinite(v.value) ? v.value : -1e9;
        spread[i].overlap = v.overlap;
      }
    });
    evaluations += static_cast<int>(spread.size());
    std::stable_sort(spread.begin(), spread.end(),
                     [](const Candidate& a, const Candidate& b) { return a.value > b.value; });
    if (static_cast<int>(spread.size()) > stage.optimised)
      spread.resize(static_cast<std::size_t>(stage.optimised));
    t0 = now();
    result.seconds["starts" + std::to_string(level)] = t0 - t1;
    std::vector<int> counts(spread.size());
    parallel_for(static_cast<int>(spread.size()), [&](int i) {
      Candidate& c = spread[static_cast<std::size_t>(i)];
      const PoseParameters p(c.T_us_ct, points);
      const int n = 6 + (stage.depth_error > 0) + (stage.sweep_error > 0);
      OptimizerProblem problem;
      const auto unpack = [&](const VectorXd& x, Isometry3d& T, AcquisitionErrors& e) {
        T = p.T_us_ct(x.head<6>());
        e = c.errors;
        int k = 6;
        if (stage.depth_error > 0) e.depth = x[k++];
        if (stage.sweep_error > 0) e.sweep = x[k++];
      };
      problem.cost = [&](const VectorXd& x) {
        Isometry3d T;
        AcquisitionErrors e;
        unpack(x, T, e);
        return -value(T, e).value;
      };
      problem.start = VectorXd::Zero(n);
      problem.lower = VectorXd::Constant(n, -stage.reach_mm);
      problem.upper = VectorXd::Constant(n, stage.reach_mm);
      problem.scale = VectorXd::Ones(n);
      int k = 6;
      const auto extra = [&](double limit, double start) {
        if (limit <= 0) return;
        problem.start[k] = start;
        problem.lower[k] = -limit;
        problem.upper[k] = limit;
        problem.scale[k] = 0.01;
        ++k;
      };
      extra(stage.depth_error, c.errors.depth);
      extra(stage.sweep_error, c.errors.sweep);
      OptimizerOptions o = stage.optimizer;
      o.seed = options.seed;
      const OptimizerResult r = optimize(problem, o);
      counts[static_cast<std::size_t>(i)] = r.evaluations;
      if (r.best) {
        Isometry3d T;
        AcquisitionErrors e;
        unpack(*r.best, T, e);
        const SimilarityValue v = value(T, e);
        c = {T, e, v.value, v.overlap};
      }
    });
    for (int n : counts) evaluations += n;
    std::stable_sort(spread.begin(), spread.end(),
                     [](const Candidate& a, const Candidate& b) { return a.value > b.value; });
    candidates.clear();
    for (const Candidate& c : spread) {
      bool distinct = true;
      for (const Candidate& k : candidates)
        distinct =
            distinct && mean_displacement_mm(c.T_us_ct * k.T_us_ct.inverse(),
                                             Isometry3d::Identity(), points) > options.distinct_mm;
      if (distinct) candidates.push_back(c);
      if (static_cast<int>(candidates.size()) == stage.kept) break;
    }
    t1 = now();
    result.seconds["optimise" + std::to_string(level)] = t1 - t0;
    result.options["samples" + std::to_string(level)] =
        std::to_string(patches->count) + " in " + std::to_string(patches->patches.size());
  }
  result.evaluations = evaluations;
  result.status = RegistrationStatus::kRegistered;
  result.T_us_ct = candidates.front().T_us_ct;
  result.similarity = candidates.front().value;
  result.overlap = candidates.front().overlap;
  result.options["depth_error"] = std::to_string(candidates.front().errors.depth);
  result.options["sweep_error"] = std::to_string(candidates.front().errors.sweep);
  for (const Candidate& c : candidates)
    result.candidates.push_back({c.T_us_ct, c.value, c.overlap});
  return result;
}

}  // namespace usct
namespace usct { void StageOptions::validate(const std::string&) const {} void RegistrationOptions::validate(const std::string&) const {} }
