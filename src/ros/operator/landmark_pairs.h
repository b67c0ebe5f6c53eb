#pragma once

#include <geometry_msgs/Point.h>
#include <us_ct_registration/SetInitialAlignment.h>
#include <visualization_msgs/MarkerArray.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace usct::ros_interface {

/// One landmark in both images, m. The first point comes from the CT.
struct LandmarkPair {
  geometry_msgs::Point ct;
  std::optional<geometry_msgs::Point> us;
};

/// Collects landmarks that a person shows one after the other, each in the CT first and then in the
/// ultrasound. The frame of a point tells in which of the two it was shown.
class LandmarkPairs {
 public:
  /// Tells which CT is held, by its frame and the checksum of its voxels. Points of another CT are
  /// forgotten.
  void hold_ct(const std::string& frame, std::uint32_t crc32);
  /// A point in the CT's frame begins a pair, or takes the place of the CT's point of a pair that
  /// is not complete. A point in any other frame completes that pair. Throws InputError if no pair
  /// waits for it, if the other points of the ultrasound lie in another frame, or if no CT is held.
  void add(const std::string& frame, const geometry_msgs::Point& point);
  /// `index` < pairs().size().
  void remove(std::size_t index);

  const std::string& ct_frame() const { return ct_frame_; }
  const std::vector<LandmarkPair>& pairs() const { return pairs_; }
  /// What a person has to do next, in words.
  std::string next_step() const;
  /// Whether there are at least 3 pairs, all complete.
  bool is_ready() const;
  /// Throws InputError unless `is_ready`.
  us_ct_registration::SetInitialAlignment::Request request() const;
  /// The points as numbered spheres, each in its own frame, and what removes those of pairs that
  /// are there no more.
  visualization_msgs::MarkerArray markers() const;

 private:
  bool is_open() const { return !pairs_.empty() && !pairs_.back().us; }

  std::vector<LandmarkPair> pairs_;
  /// The largest number of pairs so far.
  std::size_t most_ = 0;
  std::string ct_frame_;
  std::uint32_t ct_crc32_ = 0;
  std::string us_frame_;
};

}  // namespace usct::ros_interface
