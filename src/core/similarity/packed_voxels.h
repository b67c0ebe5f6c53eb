#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <mutex>

#include "large_pages.h"
#include "us_ct_registration/volume/hu_window.h"
#include "us_ct_registration/volume/volume.h"

namespace usct {

/// The highest value of a voxel in bytes.
constexpr float kLargestByte = 255.0F;

/// CT values in bytes: limited to a window, and rounded to a 255th of it. Throws InputError if the
/// window is invalid.
Volume<std::uint8_t> in_bytes(const Volume<float>& hu, const HuWindow& window);

/// The voxels of a CT, packed for fast sampling.
class PackedVoxels {
 public:
  /// Voxels in bytes on the scale of the window. Throws InputError if the grid is invalid, smaller
  /// than 2 voxels along an axis or larger than 2^29 in all, or if the window is invalid.
  PackedVoxels(Volume<std::uint8_t> bytes, const HuWindow& window);

  const Grid& grid() const { return bytes_.grid; }
  const HuWindow& window() const { return window_; }

  /// Voxel (i, j, k) is at i + j * stride_j() + k * stride_k() of the arrays that follow. The last
  /// j has no place there.
  std::size_t stride_j() const { return stride_j_; }
  std::size_t stride_k() const { return stride_k_; }
  /// Pairs of voxels: (i, j, k) in the low byte, (i, j + 1, k) in the high one.
  const LargeVector<std::uint16_t>& pairs() const { return pairs_; }
  /// The pair of the CT in the low half, that of the magnitude of its gradient in the high half.
  /// Made on first use; safe from several threads.
  const LargeVector<std::uint32_t>& with_gradient() const;
  /// Steps of the CT's byte per mm in one step of a byte of the gradient. The largest byte is a
  /// change by the whole window from one voxel to the next.
  double gradient_step_per_mm() const { return 1.0 / bytes_.grid.spacing_mm.minCoeff(); }

  /// Memory that all this takes now.
  std::size_t memory() const;

 private:
  mutable Volume<std::uint8_t> bytes_;  // no voxels once the gradient is made
  HuWindow window_;
  std::size_t stride_j_;
  std::size_t stride_k_;
  LargeVector<std::uint16_t> pairs_;
  mutable std::once_flag gradient_made_;
  mutable std::atomic<bool> has_gradient_{false};
  mutable LargeVector<std::uint32_t> with_gradient_;
};

}  // namespace usct
