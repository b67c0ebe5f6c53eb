#include "similarity/histogram_similarity.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "similarity/joint_sums.h"
#include "similarity/patch_kernel.h"

namespace usct {
namespace {

constexpr double kLowQuantile = 0.005;
constexpr double kHighQuantile = 0.995;
constexpr float kLargestByte = 255.0F;

/// Ultrasound per place of UltrasoundPatches::value; not a number where the place is only filled
/// up.
std::vector<float> ultrasound_of(const UltrasoundPatches& us) {
  std::vector<float> values(us.value.size(), std::numeric_limits<float>::quiet_NaN());
  for (const UltrasoundPatches::Patch& patch : us.patches) {
    const std::size_t strands = patch.strands();
    for (std::size_t i = 0; i < strands; ++i) {
      const std::size_t strand = patch.first_strand + i;
      const std::size_t rows = (i + 1) * patch.count / strands - i * patch.count / strands;
      for (std::size_t row = 0; row < rows; ++row) {
        const std::size_t place = us.blocks[strand / kLanes].begin + row * kLanes + strand % kLanes;
        values[place] = static_cast<float>(us.value[place] + patch.mean);
      }
    }
  }
  return values;
}

/// The quantile of what is a number; changes the order of `values`.
float quantile(std::vector<float>& values, double share) {
  const auto nth = values.begin() + std::lround(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), nth, values.end());
  return *nth;
}

/// The bin of each ultrasound value; kNoBin where there is none.
class UltrasoundBins {
 public:
  static constexpr std::uint8_t kNoBin = 255;

  UltrasoundBins(const UltrasoundPatches& us, int bins) {
    const std::vector<float> values = ultrasound_of(us);
    std::vector<float> known;
    for (const float value : values)
      if (!std::isnan(value)) known.push_back(value);
    float low = quantile(known, kLowQuantile);
    float high = quantile(known, kHighQuantile);
    if (!(high > low)) {  // nearly all of it has one value
      low = *std::min_element(known.begin(), known.end());
      high = *std::max_element(known.begin(), known.end());
    }
    const float scale = static_cast<float>(bins) / (high - low);
    for (const float value : values)
      bin_.push_back(std::isnan(value) ? kNoBin
                                       : static_cast<std::uint8_t>(
                                             std::clamp((value - low) * scale, 0.0F, bins - 0.5F)));
  }

  std::uint8_t operator[](std::size_t place) const { return bin_[place]; }

 private:
  std::vector<std::uint8_t> bin_;
};

/// Calls use(place, CT value in steps of a byte) for all places; returns the overlap.
template <typename Use>
double for_samples(const PatchKernelInput& input, bool scalar, const Use& use) {
  std::array<float, kLanes * UltrasoundPatches::kLongestStrand> values;
  const auto sample = scalar ? sample_block_scalar : sample_block_simd;
  std::size_t inside = 0;
  for (std::size_t b = 0; b < input.us.blocks.size(); ++b) {
    inside += sample(input, b, values.data());
    const std::size_t begin = input.us.blocks[b].begin;
    const std::size_t count = input.us.blocks[b].rows * kLanes;
    for (std::size_t i = 0; i < count; ++i) use(begin + i, values[i]);
  }
  return static_cast<double>(inside) / static_cast<double>(input.us.count);
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

/// The joint histogram of Mattes 2003: a sample lies in one bin of the ultrasound, and in four of
/// the CT's, as a cubic B-spline about its value says. Two bins at either end of the window are
/// there for the spline's ends.
class MutualInformation : public Similarity {
 public:
  MutualInformation(std::shared_ptr<const UltrasoundPatches> us, std::shared_ptr<const PackedCt> ct,
                    const SimilarityOptions& options)
      : us_(std::move(us)), ct_(std::move(ct)), options_(options), us_bins_(*us_, options.bins) {}

  SimilarityValue evaluate(const Eigen::Isometry3d& T_ct_us,
                           const AcquisitionErrors& errors) const override {
    const auto bins = static_cast<std::size_t>(options_.bins);
    const float scale = static_cast<float>(options_.bins - 2 * kMargin) / kLargestByte;
    const int last = options_.bins - kMargin - 1;
    std::vector<double> joint(bins * bins);
    SimilarityValue result;
    result.overlap =
        for_samples(kernel_input(*us_, *ct_, T_ct_us, errors, options_.channel), options_.scalar,
                    [&](std::size_t place, float ct) {
                      const std::uint8_t row = us_bins_[place];
                      if (row == UltrasoundBins::kNoBin) return;
                      const float at = ct * scale + static_cast<float>(kMargin);
                      const int bin = std::min(static_cast<int>(at), last);
                      add_spline(at - static_cast<float>(bin),
                                 joint.data() + row * bins + static_cast<std::size_t>(bin - 1));
                    });
    if (result.overlap > 0.0) result.value = value_of(joint);
    return result;
  }

 private:
  static constexpr int kMargin = 2;

  static void add_spline(float t, double* bins) {
    const float s = 1.0F - t;
    const float first = s * s * s * (1.0F / 6.0F);
    const float last = t * t * t * (1.0F / 6.0F);
    const float second = 2.0F / 3.0F - t * t + 0.5F * t * t * t;
    bins[0] += first;
    bins[1] += second;
    bins[2] += 1.0F - first - second - last;
    bins[3] += last;
  }

  double value_of(const std::vector<double>& joint) const {
    const auto bins = static_cast<std::size_t>(options_.bins);
    const auto total = static_cast<double>(us_->count);
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
    const double apart = of_us.nats() + of_ct.nats();
    if (options_.kind == SimilarityKind::kMattesMi) return std::max(0.0, apart - both.nats());
    return both.nats() > 0.0 ? apart / both.nats() : 1.0;
  }

  std::shared_ptr<const UltrasoundPatches> us_;
  std::shared_ptr<const PackedCt> ct_;
  SimilarityOptions options_;
  UltrasoundBins us_bins_;
};

/// Ultrasound minus its mean, per place of UltrasoundPatches::value; not a number where the place
/// is only filled up.
struct CentredUltrasound {
  explicit CentredUltrasound(const UltrasoundPatches& us) : value(ultrasound_of(us)) {
    const auto mean = static_cast<float>(mean_of(us));
    for (float& u : value) {
      u -= mean;
      if (!std::isnan(u)) square_sum += static_cast<double>(u) * u;
    }
  }
  std::vector<float> value;
  double square_sum = 0.0;
};

/// eta^2 = 1 - E[Var(U | CT)] / Var(U).
class CorrelationRatio : public Similarity {
 public:
  CorrelationRatio(std::shared_ptr<const UltrasoundPatches> us, std::shared_ptr<const PackedCt> ct,
                   const SimilarityOptions& options)
      : us_(std::move(us)), ct_(std::move(ct)), options_(options), centred_(*us_) {}

  SimilarityValue evaluate(const Eigen::Isometry3d& T_ct_us,
                           const AcquisitionErrors& errors) const override {
    const float scale = static_cast<float>(options_.bins - 1) / kLargestByte;
    std::vector<Bin> bins(static_cast<std::size_t>(options_.bins));
    SimilarityValue result;
    result.overlap = for_samples(kernel_input(*us_, *ct_, T_ct_us, errors, options_.channel),
                                 options_.scalar, [&](std::size_t place, float ct) {
                                   const float value = centred_.value[place];
                                   if (std::isnan(value)) return;
                                   const float at = ct * scale;
                                   const int bin =
                                       std::min(static_cast<int>(at), options_.bins - 2);
                                   const float share = at - static_cast<float>(bin);
                                   Bin* lower = bins.data() + bin;
                                   lower[0].add(1.0F - share, value);
                                   lower[1].add(share, value);
                                 });
    if (result.overlap == 0.0) return result;
    double explained = 0.0;
    for (const Bin& bin : bins)
      if (bin.count > 0.0) explained += bin.sum * bin.sum / bin.count;
    result.value = std::clamp(explained / centred_.square_sum, 0.0, 1.0);
    return result;
  }

 private:
  struct Bin {
    double count = 0.0;
    double sum = 0.0;  // of the ultrasound minus its mean
    void add(float weight, float value) {
      count += weight;
      sum += weight * value;
    }
  };

  std::shared_ptr<const UltrasoundPatches> us_;
  std::shared_ptr<const PackedCt> ct_;
  SimilarityOptions options_;
  CentredUltrasound centred_;
};

/// eta^2 given CT value and gradient.
class JointCorrelationRatio : public Similarity {
 public:
  JointCorrelationRatio(std::shared_ptr<const UltrasoundPatches> us,
                        std::shared_ptr<const PackedCt> ct, const SimilarityOptions& options)
      : us_(std::move(us)), ct_(std::move(ct)), options_(options), centred_(*us_) {}

  SimilarityValue evaluate(const Eigen::Isometry3d& T_ct_us,
                           const AcquisitionErrors& errors) const override {
    const JointSumsInput input{kernel_input(*us_, *ct_, T_ct_us, errors, options_.channel),
                               centred_.value.data(), options_.bins, options_.gradient_bins,
                               options_.gradient_scale_hu_per_mm};
    const JointSums sums = (options_.scalar ? joint_sums_scalar : joint_sums_simd)(input);
    SimilarityValue result;
    result.overlap = sums.inside / static_cast<double>(us_->count);
    if (!(sums.inside > 0.0)) return result;
    // A knot that few samples share explains them by chance: it is held to the mean of all.
    constexpr double kPriorSamples = 10.0;
    double explained = 0.0;
    for (std::size_t knot = 0; knot < sums.count.size(); ++knot)
      explained +=
          sums.ultrasound[knot] * sums.ultrasound[knot] / (sums.count[knot] + kPriorSamples);
    result.value = explained / centred_.square_sum;
    return result;
  }

 private:
  std::shared_ptr<const UltrasoundPatches> us_;
  std::shared_ptr<const PackedCt> ct_;
  SimilarityOptions options_;
  CentredUltrasound centred_;
};

}  // namespace

std::shared_ptr<const Similarity> make_mutual_information(
    std::shared_ptr<const UltrasoundPatches> ultrasound, std::shared_ptr<const PackedCt> ct,
    const SimilarityOptions& options) {
  return std::make_shared<MutualInformation>(std::move(ultrasound), std::move(ct), options);
}

std::shared_ptr<const Similarity> make_correlation_ratio(
    std::shared_ptr<const UltrasoundPatches> ultrasound, std::shared_ptr<const PackedCt> ct,
    const SimilarityOptions& options) {
  return std::make_shared<CorrelationRatio>(std::move(ultrasound), std::move(ct), options);
}

std::shared_ptr<const Similarity> make_joint_correlation_ratio(
    std::shared_ptr<const UltrasoundPatches> ultrasound, std::shared_ptr<const PackedCt> ct,
    const SimilarityOptions& options) {
  return std::make_shared<JointCorrelationRatio>(std::move(ultrasound), std::move(ct), options);
}

}  // namespace usct
