#include "us_ct_registration/registration/registration.h"

#include <chrono>
#include <cmath>

#include "registration/confidence.h"
#include "registration/level.h"
#include "registration/search.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/geometry/rigid.h"

namespace usct {
namespace {

using Eigen::Isometry3d;
using registration::BackgroundPoses;
using registration::Cancelled;
using registration::Candidate;
using registration::Level;
using registration::Search;

/// Data that cannot be registered; becomes the result's status and message.
struct Refusal {
  RegistrationStatus status;
  std::string message;
};

/// Wall time, from one lap to the next.
class Stopwatch {
 public:
  double lap() {
    const auto now = std::chrono::steady_clock::now();
    const double seconds = std::chrono::duration<double>(now - last_).count();
    last_ = now;
    return seconds;
  }

 private:
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

/// One registration, from images to result.
class Registration {
 public:
  Registration(const BeamUltrasound& us, const CtVolume& ct, const Isometry3d& T_us_ct_initial,
               const RegistrationOptions& options, const RegistrationHooks& hooks)
      : us_(us), ct_(ct), initial_{T_us_ct_initial, {}}, options_(options), hooks_(hooks) {}

  RegistrationResult run() {
    try {
      prepare();
      search();
      judge();
    } catch (const Cancelled&) {
      refuse({RegistrationStatus::kCancelled, "cancelled by the caller"});
    } catch (const Refusal& refusal) {
      refuse(refusal);
    }
    result_.evaluations = search_->evaluations();
    result_.version = USCT_VERSION;
    return std::move(result_);
  }

 private:
  /// The last but one stage, whose optima are ranked.
  std::size_t decisive() const {
    return options_.stages.size() < 2 ? 0 : options_.stages.size() - 2;
  }

  void report(double fraction) {
    if (hooks_.progress) hooks_.progress(fraction);
    search_->check_cancelled();
  }

  void prepare() {
    Stopwatch watch;
    search_.emplace(prepared_.points_us_mm, options_, hooks_);
    report(0.0);
    if (!initial_.T_us_ct.matrix().allFinite())
      throw Refusal{RegistrationStatus::kFailed, "the initial pose is not finite"};
    for (std::size_t i = 0; i < options_.stages.size(); ++i)
      if (options_.stages[i].optimizer.max_evaluations == 0)
        throw Refusal{RegistrationStatus::kFailed,
                      "stages[" + std::to_string(i) +
                          "].optimizer.max_evaluations is 0: no pose can be tried"};
    const Progress check = [this](double) { search_->check_cancelled(); };
    prepared_ = registration::prepare_ultrasound(us_, options_, check);
    if (prepared_.points_us_mm.size() < kLeastPoints)
      throw Refusal{RegistrationStatus::kFailed,
                    "nothing in the ultrasound counts: it is constant, or all of it is masked"};
    result_.seconds["ultrasound"] = watch.lap();
    report(0.1);

    in_reach_.emplace(
        registration::ct_in_reach(ct_, prepared_.us.beams, initial_.T_us_ct, options_));
    const registration::CtInReach& in_reach = *in_reach_;
    if (in_reach.region.size.minCoeff() < kLeastVoxels)
      throw Refusal{RegistrationStatus::kNoOverlap,
                    "the CT lies nowhere near the ultrasound at the initial pose"};
    const std::vector<Volume<float>> cts =
        registration::ct_levels(in_reach, options_, decisive() + 1, check);
    for (std::size_t i = 0; i < cts.size(); ++i) {
      search_->check_cancelled();
      levels_.push_back(make_level(i, in_reach, cts[i]));
    }
    result_.seconds["ct"] = watch.lap();
    report(0.2);
  }

  /// Of the last stage, on the CT around the best optimum alone: it has the finest images, and what
  /// it moves further than the gates allow is refused. If they are no finer than those of the
  /// decisive stage, on the same.
  void make_last_level() {
    const StageOptions& stage = options_.stages.back();
    levels_.resize(decisive() + 1);  // without that of an earlier round
    if (registration::shares_images(stage, options_.stages[decisive()])) {
      const std::shared_ptr<registration::LevelImages> images = levels_.back().images;
      levels_.push_back(refuse_blank([&] {
        return Level{images, images->similarity(stage.similarity), nullptr};
      }));
      return;
    }
    const double margin_mm =
        std::min(2.0 * options_.confidence.max_disagreement_mm, stage.reach_mm);
    // What simulates follows beams from the probe on.
    const registration::CtInReach near =
        stage.similarity.kind == SimilarityKind::kSimulatedLc2
            ? *in_reach_
            : registration::ct_around(ct_, prepared_, optima_.front().T_us_ct, margin_mm);
    if (near.region.size.minCoeff() < kLeastVoxels)
      throw Refusal{RegistrationStatus::kNoOverlap, "CT and ultrasound do not overlap"};
    levels_.push_back(
        make_level(options_.stages.size() - 1, near, registration::ct_level(near, stage)));
  }

  Level make_level(std::size_t stage, const registration::CtInReach& in_reach,
                   const Volume<float>& ct) {
    return refuse_blank([&] {
      return registration::make_level(options_.stages[stage], prepared_, in_reach, ct,
                                      stage == decisive(), options_);
    });
  }

  /// Options and images are valid: what `make` throws is ultrasound without structure.
  template <typename Make>
  static Level refuse_blank(const Make& make) {
    try {
      return make();
    } catch (const InputError& error) {
      throw Refusal{RegistrationStatus::kFailed, error.what()};
    }
  }

  /// Rounds, until what the last stage makes of the best optimum passes the gates.
  void search() {
    poses_.emplace(initial_.T_us_ct, options_, *search_);
    for (int round = 0; round < options_.rounds; ++round) {
      Stopwatch watch;
      std::vector<Candidate> candidates = search_round(round);
      candidates.insert(candidates.end(), optima_.begin(), optima_.end());
      optima_ = search_->best_distinct(std::move(candidates), kMostOptima);
      if (optima_.empty() || !std::isfinite(optima_.front().value))
        throw Refusal{RegistrationStatus::kNoOverlap,
                      "no pose in reach has CT and ultrasound overlap"};
      drop_distant();
      result_.seconds["search"] += watch.lap();
      polish();
      watch.lap();
      measure();
      result_.seconds["confidence"] += watch.lap();
      report(0.2 + 0.8 * (round + 1) / options_.rounds);
      if (registration::passes(options_.confidence, result_.measures)) break;
    }
  }

  /// How many times as many starts a round has as the first.
  static std::size_t effort(int round) { return std::size_t{1} << (2 * round); }

  /// How many times as many optima of a stage it climbs to and keeps: what earlier rounds did not
  /// find is one of hundreds of equals at the coarse stages.
  std::size_t breadth(std::size_t stage, int round) const {
    if (round == 0) return 1;
    return effort(round) * (stage == decisive() ? 4 : 8);
  }

  /// Every other round looks near the initial pose, but closely: what only the decisive stage shows
  /// has a narrow peak, which is found where starts are dense.
  static bool looks_near(int round) { return round % 2 == 1; }

  /// The initial pose and what is spread around it: of one sequence, each round a part that is four
  /// times as long.
  std::vector<Candidate> starts(int round) {
    const std::optional<StartOptions>& spread = options_.stages.front().starts;
    if (!spread) return {initial_};
    StartOptions all = *spread;
    std::size_t first = 0;
    for (int before = 0; before < round; ++before)
      first += effort(before) * static_cast<std::size_t>(spread->count);
    all.count = static_cast<int>(first + effort(round) * static_cast<std::size_t>(spread->count));
    const double share = looks_near(round) ? kNear : 1.0;
    all.rotation_rad *= share;
    all.translation_mm *= share;
    const PoseParameters pose(initial_.T_us_ct, prepared_.points_us_mm);
    const std::vector<PoseVector> vectors = spread_starts(pose, all);
    std::vector<Candidate> candidates;
    for (std::size_t i = first; i < vectors.size(); ++i)
      candidates.push_back({pose.T_us_ct(vectors[i]), {}});
    return candidates;
  }

  /// Optima of the decisive stage.
  std::vector<Candidate> search_round(int round) {
    std::vector<Candidate> candidates = starts(round);
    const std::size_t entry = looks_near(round) ? decisive() : 0;
    for (std::size_t stage = entry; stage <= decisive(); ++stage)
      candidates = climb(stage, round, options_.stages[stage == entry ? 0 : stage].optimised,
                         std::move(candidates));
    return candidates;
  }

  std::vector<Candidate> climb(std::size_t at, int round, int optimised,
                               std::vector<Candidate> candidates) {
    const StageOptions& stage = options_.stages[at];
    const Similarity& similarity = *levels_[at].similarity;
    search_->evaluate(similarity, candidates);
    Search::sort(candidates, breadth(at, round) * static_cast<std::size_t>(optimised));
    // Whoever gave the initial pose meant it: it is climbed from at every stage.
    if (at > 0 && round == 0) {
      std::vector<Candidate> initial{initial_};
      search_->evaluate(similarity, initial);
      candidates.push_back(initial.front());
    }
    search_->optimise(similarity, stage, candidates);
    return search_->best_distinct(std::move(candidates),
                                  breadth(at, round) * static_cast<std::size_t>(stage.kept));
  }

  /// What would be refused for its distance, and is pulled apart as well, does not stand in the way
  /// of the next best.
  void drop_distant() {
    while (optima_.size() > 1 &&
           search_->distance_mm(optima_.front().T_us_ct, initial_.T_us_ct) >
               options_.confidence.max_displacement_mm &&
           !holds_together(optima_.front()))
      optima_.erase(optima_.begin());
  }

  /// The last stage, from the best optimum.
  void polish() {
    best_ = optima_.front();
    if (options_.stages.size() == 1) return;
    Stopwatch watch;
    make_last_level();
    result_.seconds["ct"] += watch.lap();
    const StageOptions& stage = options_.stages.back();
    const Similarity& similarity = *levels_.back().similarity;
    std::vector<Candidate> polished{best_};
    search_->evaluate(similarity, polished);
    search_->optimise(similarity, stage, polished);
    if (!std::isfinite(polished.front().value))
      throw Refusal{RegistrationStatus::kNoOverlap, "CT and ultrasound do not overlap"};
    best_ = polished.front();
    result_.seconds["polish"] += watch.lap();
  }

  /// What is to be said of the best optimum, and of what the last stage made of it.
  void measure() {
    result_.measures.clear();  // those of an earlier round
    result_.covariance.reset();
    const Candidate& optimum = optima_.front();
    const registration::Background background =
        poses_->of(*levels_[decisive()].similarity, optimum, *search_);
    result_.measures["significance"] = background.significance(optimum.value);
    result_.measures["margin"] = margin(background.mean);
    result_.measures["displacement_mm"] = search_->distance_mm(best_.T_us_ct, initial_.T_us_ct);
    if (options_.stages.size() > 1) {
      result_.measures["disagreement_mm"] = search_->distance_mm(best_.T_us_ct, optimum.T_us_ct);
      const StageOptions& last = options_.stages.back();
      if (last.depth_error > 0.0) result_.measures["depth_error"] = best_.errors.depth;
      if (last.sweep_error > 0.0) result_.measures["sweep_error"] = best_.errors.sweep;
    }
    measure_accuracy();
  }

  /// How much lower the best rival is, as a share of the best optimum's height above `background`.
  double margin(double background) {
    const Candidate& best = optima_.front();
    const auto lower = [&](const Candidate& other) {
      return (best.value - other.value) / (best.value - background);
    };
    for (std::size_t i = 1; i < optima_.size(); ++i) {
      if (search_->distance_mm(optima_[i].T_us_ct, best.T_us_ct) <= kElsewhereMm) continue;
      // Only what would be refused for it is worth a closer look.
      if (lower(optima_[i]) >= options_.confidence.min_margin || holds_together(optima_[i]))
        return lower(optima_[i]);
    }
    // What is not among the optima is lower than the last of them.
    return optima_.size() < kMostOptima ? 1.0 : lower(optima_.back());
  }

  /// What parts of the ultrasound pull apart is no rival.
  bool holds_together(const Candidate& candidate) {
    const std::optional<registration::PoseAccuracy> accuracy = accuracy_of(candidate);
    return !accuracy || accuracy->scatter_mm <= options_.confidence.max_scatter_mm;
  }

  /// By the second similarity: it did not choose the pose.
  std::optional<registration::PoseAccuracy> accuracy_of(const Candidate& candidate) const {
    const Level& level = levels_[decisive()];
    return registration::pose_accuracy(level.confirmation ? *level.confirmation : *level.similarity,
                                       candidate, options_.confidence, *search_);
  }

  void measure_accuracy() {
    const std::optional<registration::PoseAccuracy> accuracy = accuracy_of(best_);
    if (!accuracy) return;
    result_.covariance = accuracy->covariance;
    result_.measures["scatter_mm"] = accuracy->scatter_mm;
    result_.measures["expected_error_mm"] =
        registration::expected_error_mm(accuracy->covariance, prepared_.points_us_mm);
  }

  void judge() {
    result_.similarity = optima_.front().value;
    result_.overlap = best_.overlap;
    result_.candidates.push_back({best_.T_us_ct, optima_.front().value, best_.overlap});
    for (std::size_t i = 1; i < optima_.size(); ++i)
      result_.candidates.push_back({optima_[i].T_us_ct, optima_[i].value, optima_[i].overlap});
    registration::judge(options_.confidence, result_);
    if (result_.status == RegistrationStatus::kRegistered) result_.T_us_ct = best_.T_us_ct;
    report(1.0);
  }

  void refuse(const Refusal& refusal) {
    result_.status = refusal.status;
    result_.message = refusal.message;
    result_.T_us_ct.reset();
  }

  static constexpr std::size_t kLeastPoints = 100;
  static constexpr int kLeastVoxels = 4;
  static constexpr std::size_t kMostOptima = 16;
  /// How far starts of a near round are spread, as a share of the others.
  static constexpr double kNear = 0.5;
  /// A second optimum closer than this is the slope of the first, mm.
  static constexpr double kElsewhereMm = 10.0;

  const BeamUltrasound& us_;
  const CtVolume& ct_;
  const Candidate initial_;
  const RegistrationOptions& options_;
  const RegistrationHooks& hooks_;

  registration::PreparedUltrasound prepared_;
  std::optional<registration::CtInReach> in_reach_;
  std::vector<Level> levels_;
  std::optional<Search> search_;
  std::optional<BackgroundPoses> poses_;
  std::vector<Candidate> optima_;  // of the decisive stage, best first
  Candidate best_;
  RegistrationResult result_;
};

}  // namespace

RegistrationResult register_ultrasound(const BeamUltrasound& ultrasound, const CtVolume& ct,
                                       const Isometry3d& T_us_ct_initial,
                                       const RegistrationOptions& options,
                                       const RegistrationHooks& hooks) {
  ultrasound.validate();
  options.validate();
  ultrasound.beams.validate();
  ct.validate("CT");
  if (T_us_ct_initial.matrix().allFinite()) require_rigid(T_us_ct_initial, "T_us_ct_initial");
  return Registration(ultrasound, ct, T_us_ct_initial, options, hooks).run();
}

}  // namespace usct
