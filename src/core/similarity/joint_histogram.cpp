#include "similarity/joint_histogram.h"

#include <algorithm>
#include <cmath>

#include "order_statistics.h"
#include "similarity/packed_ct.h"

namespace usct {
namespace {

constexpr double kLowQuantile = 0.005;
constexpr double kHighQuantile = 0.995;
/// Bins at either end of the CT's window that only the tails of splines reach.
constexpr int kMargin = 2;
/// Bin number of padding.
constexpr std::uint8_t kNoBin = 255;

/// The bin of the ultrasound at each place; kNoBin at padding.
std::vector<std::uint8_t> ultrasound_bins(const UltrasoundPatches& us, int bins) {
  const std::vector<float> values = ultrasound_of(us);
  std::vector<float> known;
  for (const float value : values)
    if (!std::isnan(value)) known.push_back(value);
  float low = nearest_quantile(known, kLowQuantile);
  float high = nearest_quantile(known, kHighQuantile);
  if (!(high > low)) {  // nearly all samples have one value
    low = *std::min_element(known.begin(), known.end());
    high = *std::max_element(known.begin(), known.end());
  }
  const float scale = static_cast<float>(bins) / (high - low);
  std::vector<std::uint8_t> bin;
  bin.reserve(values.size());
  for (const float value : values)
    bin.push_back(std::isnan(value) ? kNoBin
                                    : static_cast<std::uint8_t>(
                                          std::clamp((value - low) * scale, 0.0F, bins - 0.5F)));
  return bin;
}

/// Sum of -p log p.
class Entropy {
 public:
  void add(double p) {
    if (p > 0.0) sum_ -= p * std::log(p);
  }
  double nats() const { return sum_; }

 private:
  double sum_ = 0.0;
};

void add_spline(float t, double* bins) {
  const float s = 1.0F - t;
  const float first = s * s * s * (1.0F / 6.0F);
  const float last = t * t * t * (1.0F / 6.0F);
  const float second = 2.0F / 3.0F - t * t + 0.5F * t * t * t;
  bins[0] += first;
  bins[1] += second;
  bins[2] += 1.0F - first - second - last;
  bins[3] += last;
}

}  // namespace

JointHistogram::JointHistogram(SampledImages images, int bins)
    : images_(std::move(images)), bins_(bins), us_bins_(ultrasound_bins(*images_.us, bins)) {}

std::vector<double> JointHistogram::at(const SimilarityPose& pose, double& overlap) const {
  const auto bins = static_cast<std::size_t>(bins_);
  const float scale = static_cast<float>(bins_ - 2 * kMargin) / kLargestByte;
  const int last = bins_ - kMargin - 1;
  std::vector<double> joint(bins * bins);
  overlap = for_samples(images_.backend, images_.input(pose), [&](std::size_t place, float ct) {
    const std::uint8_t row = us_bins_[place];
    if (row == kNoBin) return;
    const float at = ct * scale + static_cast<float>(kMargin);
    const int bin = std::min(static_cast<int>(at), last);
    add_spline(at - static_cast<float>(bin),
               joint.data() + row * bins + static_cast<std::size_t>(bin - 1));
  });
  return joint;
}

Entropies JointHistogram::entropies_of(const std::vector<double>& joint) const {
  const auto bins = static_cast<std::size_t>(bins_);
  const auto total = static_cast<double>(images_.us->count);
  Entropy both, of_us, of_ct;
  std::vector<double> ct(bins);
  for (std::size_t row = 0; row < bins; ++row) {
    double sum = 0.0;
    for (std::size_t bin = 0; bin < bins; ++bin) {
      const double p = joint[row * bins + bin] / total;
      both.add(p);
      sum += p;
      ct[bin] += p;
    }
    of_us.add(sum);
  }
  for (const double p : ct) of_ct.add(p);
  return {of_us.nats(), of_ct.nats(), both.nats()};
}

}  // namespace usct
