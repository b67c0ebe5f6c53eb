#pragma once

// The kernels leave out these instructions as well.
#define HWY_DISABLED_TARGETS HWY_SSSE3
// Some kernels have instructions that few processors have.
#define HWY_WANT_AVX3_DL
#include <hwy/highway.h>

#include <cstdint>
#include <vector>

namespace usct::test {

/// Makes the kernels run with instructions other than the best as long as this object exists.
class Instructions {
 public:
  explicit Instructions(std::int64_t target) { use(target); }
  ~Instructions() { use(0); }
  Instructions(const Instructions&) = delete;
  Instructions& operator=(const Instructions&) = delete;

  static std::vector<std::int64_t> all() { return hwy::SupportedAndGeneratedTargets(); }

 private:
  static void use(std::int64_t target) {
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  }
};

}  // namespace usct::test
