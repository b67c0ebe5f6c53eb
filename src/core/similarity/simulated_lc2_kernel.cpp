#include "similarity/simulated_lc2_kernel.h"

#include <algorithm>
#include <cmath>

// Vectors are struct members, which rules out scalable ones; SSSE3 without SSE4 is extinct.
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "similarity/simulated_lc2_kernel.cpp"
#include <hwy/foreach_target.h>
// This must come after foreach_target.h.
#include <hwy/cache_control.h>
#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include "similarity/simulated_lc2_sums-inl.h"
#include "similarity/simulated_lc2_voxels-inl.h"

HWY_BEFORE_NAMESPACE();
namespace usct::simulated_lc2::HWY_NAMESPACE {
namespace {

/// A sample of each beam lies in this cell of the CT.
struct Place {
  Cell cell;
  M inside;    // the CT
  bool inner;  // all beams, and the points of their gradients, are inside
};

/// The medium at one sample; the gradient of mu is 0 outside the body.
struct Medium {
  V mu;
  V gradient_square;  // (HU per mm)^2
  V along_beam;       // HU per mm
  M total;            // total reflection by a threshold
};

/// A sample returns this to each of the beams.
struct Returned {
  V p, strength;  // mapped CT; the reflection before its log compression, 0 to 1
  M hidden;       // the sound does not arrive
};

/// A sample where the ultrasound counts returns this.
struct Echo {
  V p, strength;
  M insonified, occluded;
};

/// As many beams as a vector has lanes, beginning at `lane` of the block. Samples go through four
/// steps, each of which takes a run of them: a processor overlaps the samples of a step, which wait
/// for memory or for the logarithm, but not the long sequence of all steps.
template <bool kNearest>
class Beams {
 public:
  HWY_INLINE Beams(const Scene& scene, const Block& block, int lane)
      : scene_(scene),
        block_(block),
        ultrasound_(block.ultrasound + lane),
        first_(load(block.first, lane)),
        step_(load(block.step, lane)),
        log_factor_(1.0F / std::log1p(scene.log_a)),
        inner_(inner_samples(scene, first_, step_)) {}

  HWY_INLINE void run(Sums& sums) {
    for (int n = 0; n < kRun; ++n) locate(n, places_[n]);
    for (int begin = 0; begin < block_.samples; begin += kRun) {
      const int count = std::min(kRun, block_.samples - begin);
      for (int n = 0; n < count; ++n) interpolate(places_[n], voxels_[n]);
      if (begin + count <= block_.first_used) {
        for (int n = 0; n < count; ++n) {
          travel(places_[n], voxels_[n]);
          locate(begin + kRun + n, places_[n]);
        }
        continue;
      }
      for (int n = 0; n < count; ++n) echoes_[n] = echo_of(begin + n, places_[n], voxels_[n], sums);
      for (int n = 0; n < count; ++n) {
        add(ultrasound(begin + n), echoes_[n], sums);
        locate(begin + kRun + n, places_[n]);
      }
      accumulators_.flush();
    }
    accumulators_.add_to(sums);
  }

 private:
  static HWY_INLINE Index load(const float (&rows)[3][kLinesPerBlock], int lane) {
    return {hn::LoadU(d, rows[0] + lane), hn::LoadU(d, rows[1] + lane),
            hn::LoadU(d, rows[2] + lane)};
  }

  HWY_INLINE Index index_of(int sample) const {
    const V n = hn::Set(d, static_cast<float>(sample));
    return {hn::MulAdd(step_.x, n, first_.x), hn::MulAdd(step_.y, n, first_.y),
            hn::MulAdd(step_.z, n, first_.z)};
  }

  /// Also prefetches the voxels there: the CT is larger than the caches, and each beam takes its
  /// own path through it.
  HWY_INLINE void locate(int sample, Place& place) const {
    const Index index = index_of(sample);
    place.inner = inner_.contains(sample);
    place.inside = place.inner ? hn::FirstN(d, hn::Lanes(d)) : contains(scene_, index);
    place.cell = cell_at(scene_, place.inner && !kNearest ? index : kept_within(scene_, index));
    HWY_ALIGN std::int32_t lower[kLinesPerBlock];
    hn::Store(place.cell.lower, di, lower);
    // Neighbouring beams are about a voxel apart, and a line of the cache holds eight voxels.
    for (std::size_t lane = 0; lane < hn::Lanes(d); lane += 2) {
      fetch_rows(scene_.voxels + lower[lane]);
      if (scene_.windowed && scene_.by_threshold) fetch_rows(scene_.hu + lower[lane]);
    }
  }

  /// Prefetches the voxels of a cell.
  template <typename Voxel>
  HWY_INLINE void fetch_rows(const Voxel* row) const {
    hwy::Prefetch(row);
    if (kNearest) return;
    const Strides step(scene_);
    hwy::Prefetch(row + step.y);
    hwy::Prefetch(row + step.z);
    hwy::Prefetch(row + step.y + step.z);
  }

  HWY_INLINE V ultrasound(int sample) const {
    return hn::LoadU(d, ultrasound_ + static_cast<std::ptrdiff_t>(sample) * kLinesPerBlock);
  }

  /// Whether all beams are occluded there, or outside the CT. What is dark remains so.
  HWY_INLINE bool is_empty(const Place& place) const {
    const M dark = hn::AndNot(hn::Gt(echo_samples_, hn::Zero(d)), occluded_);
    return hn::AllFalse(d, hn::AndNot(dark, place.inside));
  }

  HWY_INLINE void interpolate(const Place& place, Voxels& voxels) const {
    if (!is_empty(place)) voxels = sample<kNearest>(scene_, place.cell);
  }

  /// The sound travels through a sample.
  HWY_INLINE Returned travel(const Place& place, const Voxels& voxels) {
    Returned returned{mapped(hn::Set(d, scene_.outside_mu)), hn::Zero(d), none()};
    if (!is_empty(place)) {
      const V lost_before = lost_;
      const M occluded_before = occluded_;
      const Medium medium = medium_at(place, voxels);
      transmit(medium);
      returned.p = mapped(medium.mu);
      if (!scene_.on_intensity) returned.strength = reflected(medium, lost_before);
      if (block_.echo_samples > 0)
        begin_echo(hn::AndNot(occluded_before, occluded_), returned.strength);
    }
    if (scene_.on_intensity) returned.strength = lost_share();
    const M echoes = hn::Gt(echo_samples_, hn::Zero(d));
    if (block_.echo_samples > 0) {
      returned.strength = hn::IfThenElse(echoes, echo_, returned.strength);
      echo_samples_ = hn::Sub(echo_samples_, hn::Set(d, 1.0F));
    }
    returned.hidden = hn::AndNot(echoes, occluded_);
    return returned;
  }

  HWY_INLINE Echo echo_of(int sample, const Place& place, const Voxels& voxels, Sums& sums) {
    const auto [p, strength, hidden] = travel(place, voxels);
    const V us = ultrasound(sample);
    const M usable = hn::Eq(us, us);
    const M in_body = hn::And(usable, hn::And(place.inside, in_body_));
    const M used = scene_.use_background ? usable : in_body;
    sums.in_body += count(in_body);
    return {p, strength, hn::AndNot(hidden, used), hn::And(hidden, used)};
  }

  HWY_INLINE void add(V us, const Echo& echo, Sums& sums) {
    sums.insonified += count(echo.insonified);
    accumulators_.add(
        hn::IfThenElseZero(echo.insonified, us),
        hn::IfThenElseZero(echo.insonified, hn::Sub(echo.p, hn::Set(d, scene_.p_origin))),
        hn::IfThenElseZero(echo.insonified, compressed(echo.strength)));
    if (HWY_UNLIKELY(!hn::AllFalse(d, echo.occluded))) {
      sums.occluded += count(echo.occluded);
      accumulators_.add_occluded(hn::IfThenElseZero(echo.occluded, us));
    }
  }

  /// Beams that end in `where` keep their reflection as long as the echo lasts.
  HWY_INLINE void begin_echo(M where, V strength) {
    echo_ = hn::IfThenElse(where, scene_.on_intensity ? hn::Set(d, 1.0F) : strength, echo_);
    const V samples = hn::Set(d, static_cast<float>(block_.echo_samples));
    echo_samples_ = hn::IfThenElse(where, samples, echo_samples_);
  }

  static HWY_INLINE std::int64_t count(M mask) {
    return static_cast<std::int64_t>(hn::CountTrue(d, mask));
  }

  HWY_INLINE Medium medium_at(const Place& place, const Voxels& voxels) {
    const Cell& cell = place.cell;
    const M inside = place.inside;
    const M waiting = hn::AndNot(in_body_, inside);
    const bool any_waiting = !hn::AllFalse(d, waiting);
    const bool as_it_is = scene_.windowed && (scene_.by_threshold || any_waiting);
    const V hu = as_it_is ? hu_at(scene_, cell) : voxels.hu;
    const V gas = hn::Set(d, scene_.gas_hu);
    if (HWY_UNLIKELY(any_waiting)) {
      // Samples less than a rounding error below the threshold are decided by free_of_gas.
      const M perhaps = hn::And(waiting, hn::Gt(hu, hn::Sub(gas, hn::Set(d, 1.0F))));
      if (!hn::AllFalse(d, perhaps))
        in_body_ =
            hn::Or(in_body_, free_of_gas(scene_, cell.index, hu, voxels.difference, perhaps));
    }
    const M body = hn::And(inside, in_body_);

    const V mu =
        hn::Max(hn::Add(voxels.hu, hn::Set(d, scene_.hu_shift)), hn::Set(d, scene_.mu_floor));
    const Index change = per_voxel(scene_, place.inner, cell.index, voxels.difference);
    const V x = hn::Mul(change.x, hn::Set(d, scene_.voxels_per_mm[0]));
    const V y = hn::Mul(change.y, hn::Set(d, scene_.voxels_per_mm[1]));
    const V z = hn::Mul(change.z, hn::Set(d, scene_.voxels_per_mm[2]));
    const V square = hn::MulAdd(x, x, hn::MulAdd(y, y, hn::Mul(z, z)));
    const V per_sample =
        hn::MulAdd(change.x, step_.x, hn::MulAdd(change.y, step_.y, hn::Mul(change.z, step_.z)));
    Medium medium{
        hn::IfThenElse(body, mu, hn::Set(d, scene_.outside_mu)), hn::IfThenElseZero(body, square),
        hn::IfThenElseZero(body, hn::Mul(per_sample, hn::Set(d, block_.per_sample_mm))), none()};
    if (scene_.by_threshold) {
      const M dense = hn::Or(hn::Ge(hu, hn::Set(d, scene_.bone_hu)), hn::Lt(hu, gas));
      const M steep = hn::Ge(hn::Sqrt(square), hn::Set(d, scene_.total_hu_per_mm));
      medium.total = hn::And(body, hn::Or(dense, steep));
    }
    return medium;
  }

  /// The factor l / (2 mu).
  HWY_INLINE V scale(const Medium& medium) const {
    return hn::Div(hn::Set(d, scene_.half_length_mm), medium.mu);
  }

  /// Eqs 4.4 and 4.6. The loss 1 - I keeps the precision that I near 1 would lose.
  HWY_INLINE void transmit(const Medium& medium) {
    const V over_mu = scale(medium);
    const V one = hn::Set(d, 1.0F);
    V loss = hn::Mul(medium.gradient_square, hn::Mul(over_mu, over_mu));
    occluded_ = hn::Or(occluded_, hn::Or(medium.total, hn::Ge(loss, one)));
    if (block_.transmission_power > 0.0F) {
      // 1 - t^power, by -log t = log(1 + loss / (1 - loss)).
      const V below_one = hn::Min(loss, hn::Set(d, 1.0F - 6e-8F));
      const V minus_log_t = hn::Log1p(d, hn::Div(below_one, hn::Sub(one, below_one)));
      loss = hn::Neg(hn::Expm1(d, hn::Mul(hn::Set(d, -block_.transmission_power), minus_log_t)));
    }
    lost_ = hn::Min(one, hn::MulAdd(loss, hn::Sub(one, lost_), lost_));
  }

  /// Eqs 4.3 and 4.5.
  HWY_INLINE V reflected(const Medium& medium, V lost_before) const {
    const V one = hn::Set(d, 1.0F);
    const V over_mu = scale(medium);
    const V gradient = hn::Sqrt(medium.gradient_square);
    const V delta =
        hn::Mul(hn::Mul(hn::Abs(medium.along_beam), gradient), hn::Mul(over_mu, over_mu));
    const V share = hn::IfThenElse(medium.total, one, hn::Min(one, delta));
    const V strength =
        hn::Mul(hn::Mul(hn::Sub(one, lost_before), share), hn::Set(d, scene_.reflection_scale));
    const V r = hn::Min(one, strength);
    return scene_.signed_reflection ? hn::CopySign(r, medium.along_beam) : r;
  }

  /// The s with which eq 4.7 as printed, 1 - log(1 + a I) / log(1 + a), is log(1 + a s) / log(1 +
  /// a).
  HWY_INLINE V lost_share() const {
    const V one = hn::Set(d, 1.0F);
    return hn::Div(lost_, hn::MulAdd(hn::Set(d, scene_.log_a), hn::Sub(one, lost_), one));
  }

  /// Eq 4.7: sign(s) log(1 + a |s|) / log(1 + a).
  HWY_INLINE V compressed(V strength) const {
    const V magnitude = scene_.signed_reflection ? hn::Abs(strength) : strength;
    const V scaled = hn::Mul(magnitude, hn::Set(d, scene_.log_a));
    // The losses of a beam are small, and need the precision.
    const V log =
        scene_.on_intensity ? hn::Log1p(d, scaled) : hn::Log(d, hn::Add(scaled, hn::Set(d, 1.0F)));
    const V r = hn::Mul(log, hn::Set(d, log_factor_));
    return scene_.signed_reflection ? hn::CopySign(r, strength) : r;
  }

  /// Eq 4.8.
  HWY_INLINE V mapped(V mu) const {
    const V p = hn::MulAdd(hn::Set(d, scene_.slope), hn::Sub(mu, hn::Set(d, scene_.outside_mu)),
                           hn::Set(d, scene_.outside_p));
    return hn::Min(hn::Max(p, hn::Set(d, scene_.least_p)), hn::Set(d, scene_.most_p));
  }

  const Scene& scene_;
  const Block& block_;
  const float* ultrasound_;
  Index first_, step_;
  float log_factor_;
  Range inner_;
  Place places_[kRun];
  Voxels voxels_[kRun];
  Echo echoes_[kRun];
  V lost_ = hn::Zero(d);  // 1 - I
  M occluded_ = none();
  M in_body_ = none();
  /// Samples for which the surface that ended a beam still echoes, and its r.
  V echo_samples_ = hn::Zero(d);
  V echo_ = hn::Zero(d);
  Accumulators accumulators_;
};

void add_block(const Scene& scene, const Block& block, Sums& sums) {
  for (int lane = 0; lane < kLinesPerBlock; lane += static_cast<int>(hn::Lanes(d)))
    if (scene.nearest)
      Beams<true>(scene, block, lane).run(sums);
    else
      Beams<false>(scene, block, lane).run(sums);
}

}  // namespace
}  // namespace usct::simulated_lc2::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace usct::simulated_lc2 {

Sums& Sums::operator+=(const Sums& other) {
  in_body += other.in_body;
  insonified += other.insonified;
  occluded += other.occluded;
  u += other.u;
  p += other.p;
  r += other.r;
  uu += other.uu;
  up += other.up;
  ur += other.ur;
  pp += other.pp;
  pr += other.pr;
  rr += other.rr;
  u_occluded += other.u_occluded;
  uu_occluded += other.uu_occluded;
  return *this;
}

HWY_EXPORT(add_block);

void add_block(const Scene& scene, const Block& block, Sums& sums) {
  HWY_DYNAMIC_DISPATCH(add_block)(scene, block, sums);
}

}  // namespace usct::simulated_lc2
#endif
