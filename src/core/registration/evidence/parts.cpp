#include "registration/evidence/parts.h"

#include <algorithm>
#include <array>
#include <numeric>

#include "parallel.h"
#include "ultrasound/moving_place.h"
#include "us_ct_registration/similarity/catalogue.h"

namespace usct::registration {
namespace {

enum class Along { kLines, kFrames };

/// The place of each frame in their order along the way from the first to the one that lies
/// farthest from it. A probe that goes there and back, or in a trembling hand, is at one place
/// several times: halves by time would share their tissue.
std::vector<int> places_of_frames(const BeamGrid& beams) {
  const auto [line, sample] = moving_place(beams);
  std::vector<Eigen::Vector3d> from_first;
  for (int f = 0; f < beams.frames; ++f)
    from_first.push_back(beams.point(f, line, sample) - beams.point(0, line, sample));
  const Eigen::Vector3d farthest =
      *std::max_element(from_first.begin(), from_first.end(),
                        [](const auto& a, const auto& b) { return a.norm() < b.norm(); });
  std::vector<std::size_t> frames(from_first.size());
  std::iota(frames.begin(), frames.end(), 0);
  std::stable_sort(frames.begin(), frames.end(), [&](std::size_t a, std::size_t b) {
    return from_first[a].dot(farthest) < from_first[b].dot(farthest);
  });
  std::vector<int> places(frames.size());
  for (std::size_t i = 0; i < frames.size(); ++i) places[frames[i]] = static_cast<int>(i);
  return places;
}

/// The sample masks of the two halves along lines or frames, with as many known samples each.
std::array<std::shared_ptr<BeamUltrasound>, 2> halves_of(const BeamUltrasound& us, Along along) {
  const BeamGrid& beams = us.beams;
  const auto samples = static_cast<std::size_t>(beams.samples());
  const std::vector<int> places =
      along == Along::kFrames ? places_of_frames(beams) : std::vector<int>();
  const auto position = [&](int frame, int line) {
    return along == Along::kLines ? line : places[static_cast<std::size_t>(frame)];
  };
  std::vector<std::size_t> known(
      static_cast<std::size_t>(along == Along::kLines ? beams.lines : beams.frames));
  std::array<std::shared_ptr<BeamUltrasound>, 2> halves{std::make_shared<BeamUltrasound>(us),
                                                        std::make_shared<BeamUltrasound>(us)};
  for (auto& half : halves)
    if (half->known.empty()) half->known.assign(us.brightness.size(), 1);
  const std::vector<std::uint8_t> all = halves[0]->known;
  const auto for_beams = [&](const auto& use) {
    std::size_t begin = 0;
    for (int f = 0; f < beams.frames; ++f)
      for (int l = 0; l < beams.lines; ++l, begin += samples) use(position(f, l), begin);
  };
  std::size_t total = 0;
  for_beams([&](int at, std::size_t begin) {
    for (std::size_t i = begin; i < begin + samples; ++i)
      if (all[i] != 0) {
        ++known[static_cast<std::size_t>(at)];
        ++total;
      }
  });
  int split = 0;
  for (std::size_t sum = 0; 2 * sum < total; ++split) sum += known[static_cast<std::size_t>(split)];
  for_beams([&](int at, std::size_t begin) {
    auto& other = halves[at < split ? 1 : 0]->known;
    std::fill_n(other.begin() + static_cast<std::ptrdiff_t>(begin), samples, 0);
  });
  return halves;
}

/// The pose that one half leads to; without a value if it has nothing to explain.
Candidate pose_of(SimilarityImages& half, const SimilarityOptions& similarity,
                  const PartOptions& options, const Eigen::Isometry3d& T_us_ct,
                  const FieldPoints& field, Run& run) {
  const std::shared_ptr<const Similarity> part = make_similarity(half, similarity);
  if (!part) return {};
  return climbed(*part, {options.optimizer, options.reach_mm, {}}, field, {T_us_ct, {}}, run);
}

}  // namespace

std::vector<std::optional<HalfPoses>> poses_of_halves(
    const SimilarityImages& images, const std::vector<SimilarityOptions>& similarities,
    const PartOptions& options, const Eigen::Isometry3d& T_us_ct, const FieldPoints& field,
    Run& run) {
  std::vector<std::shared_ptr<BeamUltrasound>> halves;
  for (const Along along : {Along::kLines, Along::kFrames})
    for (auto& half : halves_of(images.ultrasound(), along)) halves.push_back(std::move(half));
  const bool need_beams =
      std::any_of(similarities.begin(), similarities.end(),
                  [](const SimilarityOptions& one) { return needs_of(one).beams; });
  // A half is cut into patches once for all similarities whose patches are alike.
  std::vector<std::vector<Candidate>> found(similarities.size(),
                                            std::vector<Candidate>(halves.size()));
  parallel_for(static_cast<int>(halves.size()), [&](int i) {
    const auto at = static_cast<std::size_t>(i);
    SimilarityImages half(halves[at], images.packed_ct(), nullptr, need_beams, images.backend());
    for (std::size_t s = 0; s < similarities.size(); ++s)
      found[s][at] = pose_of(half, similarities[s], options, T_us_ct, field, run);
  });
  std::vector<std::optional<HalfPoses>> poses;
  for (const std::vector<Candidate>& of : found) {
    const bool all = std::all_of(of.begin(), of.end(),
                                 [](const Candidate& candidate) { return candidate.has_value(); });
    poses.push_back(
        all ? std::optional(HalfPoses{of[0].T_us_ct, of[1].T_us_ct, of[2].T_us_ct, of[3].T_us_ct})
            : std::nullopt);
  }
  return poses;
}

}  // namespace usct::registration
