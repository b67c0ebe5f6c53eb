#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "us_ct_registration/ultrasound/image_lag.h"
#include "us_ct_registration/ultrasound/sweep_assembly.h"

/// Sweeps of live B-mode images: images that come without poses, by another way than the poses of
/// the probe, and with duplicates (captured video repeats images). Times are nanoseconds since
/// 1970.
namespace usct {

struct ImageSweepOptions {
  /// The beams along which the images are resampled.
  AxialSampling axial;
  Array array;
  /// Name of the US frame.
  std::string us_frame_id;
  /// An image repeats the one before if their mean absolute difference along the beams is at most
  /// this, in grey values.
  double repeat_tolerance = 0.0;
  /// Longest time between the stamps of two images of a sweep.
  double longest_pause_s = 1.0;
  /// Largest share of a sweep's images that may be without a pose.
  double max_missing = 0.1;
  /// Most images, and most bytes of brightness, of a sweep.
  int max_frames = 2000;
  std::size_t max_bytes = std::size_t{1} << 30;
  /// An image stamped t shows what the probe saw at t - lag, as far as it is known beforehand.
  double image_lag_s = 0.0;
  /// Whether the lag that the images determine is corrected; else it is only reported.
  bool correct_lag = true;
};

/// The pose of the array at one time: maps frame coordinates to the US frame, mm. Empty if it is
/// not known, with the reason in words.
struct ArrayPoseThen {
  std::optional<Eigen::Isometry3d> T_us_frame;
  std::string problem;
};
using ArrayPoseAt = std::function<ArrayPoseThen(std::int64_t stamp_ns)>;

/// The images of one sweep, as they arrive.
class ImageSweep {
 public:
  struct Image {
    std::int64_t stamp_ns;
    /// Along the beams, lines x samples, samples fastest; shared by images that repeat each other.
    std::shared_ptr<const std::vector<std::uint8_t>> brightness;
  };

  ImageSweep(const ImageSweepOptions& options, std::uint32_t number)
      : options_(options), number_(number) {}

  /// Takes the next image. The number of values of `brightness` must be that of the options.
  /// Throws InputError, naming the sweep, if the sweep cannot go on: the stamp is before that of
  /// the last image or too long after it, or the sweep becomes too large. An image with the stamp
  /// of the last one is dropped.
  void add(std::int64_t stamp_ns, std::vector<std::uint8_t> brightness);

  const ImageSweepOptions& options() const { return options_; }
  std::uint32_t number() const { return number_; }
  std::string name() const { return "sweep " + std::to_string(number_); }
  const std::vector<Image>& images() const { return images_; }
  /// Number of images that differ from the one before.
  int distinct() const { return distinct_; }
  /// Number of images that were dropped because they had the stamp of the one before.
  std::uint64_t same_stamp() const { return same_stamp_; }

 private:
  bool repeats_last(const std::vector<std::uint8_t>& brightness) const;

  ImageSweepOptions options_;
  std::uint32_t number_;
  std::vector<Image> images_;
  int distinct_ = 0;
  std::size_t bytes_ = 0;
  std::uint64_t same_stamp_ = 0;
};

/// A sweep of images with the poses at which they were seen.
struct PlacedSweep {
  AssembledSweep assembled;
  /// Images that were left out, by reason.
  Counts dropped;
  /// The lag by the images of this sweep; `lag_s` includes `image_lag_s` of the options.
  LagEstimate lag;
  /// The lag that was corrected, and where it comes from, in words.
  double corrected_lag_s = 0.0;
  std::string lag_source;
  /// A fault of the sweep that a person should know of, in words; empty if there is none.
  std::string warning;
};

/// Gives each image its pose at its stamp minus the lag, and leaves out repeated images.
///
/// The lag is `image_lag_s`, unless `correct_lag` is set and the images determine it, those of this
/// sweep or of an earlier one (`known`): see `better_lag`.
///
/// Throws InputError, naming the sweep, if the images or the poses do not change, if images do not
/// change over more than half of the probe's path, or if more than `max_missing` have no pose.
PlacedSweep place_images(const ImageSweep& sweep, const ArrayPoseAt& pose_at,
                         const std::optional<LagEstimate>& known);

/// The better of two estimates of the same lag: the one that is determined; if both are, the one
/// with the smaller standard error, or the later one if they contradict each other by more than
/// three standard errors (the recording was changed). Empty if neither is determined.
std::optional<LagEstimate> better_lag(const std::optional<LagEstimate>& earlier,
                                      const LagEstimate& later);

}  // namespace usct
