#pragma once

#include <algorithm>

#include "parallel.h"
#include "us_ct_registration/similarity/similarity.h"

namespace usct {

/// Base of the similarities that evaluate one pose after another on the processor.
class PoseByPose : public Similarity {
 public:
  using Similarity::evaluate;

  void evaluate(const SimilarityPose* poses, std::size_t count, SimilarityValue* values,
                const Check& check) const final {
    const auto one = [&](std::size_t i) {
      if (check) check();
      values[i] = value_at(poses[i]);
    };
    if (count == 1) return one(0);
    // A pose takes microseconds at a coarse level, so each thread takes several at a time.
    constexpr std::size_t kShare = 16;
    parallel_for(static_cast<int>((count + kShare - 1) / kShare), [&](int share) {
      const std::size_t begin = static_cast<std::size_t>(share) * kShare;
      for (std::size_t i = begin; i < std::min(count, begin + kShare); ++i) one(i);
    });
  }

 protected:
  virtual SimilarityValue value_at(const SimilarityPose& pose) const = 0;
};

}  // namespace usct
