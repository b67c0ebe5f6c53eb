#pragma once

#include <cstdint>
#include <vector>

#include "us_ct_registration/phantom/anatomy.h"
#include "us_ct_registration/phantom/phantom.h"
#include "us_ct_registration/volume/volume.h"

namespace usct::phantom {

/// A real CT as anatomy: tissues are those of the label map, smoothed; voxels without a label are
/// classified by HU.
class CtAnatomy : public Anatomy {
 public:
  /// Throws InputError if the CT shows no body, a label is not in the map, or the kidney's centre
  /// lies outside the CT.
  CtAnatomy(std::uint64_t seed, const CtVolume& ct, const LabelVolume& labels,
            const FromCtOptions& from_ct, const AnatomyOptions& options);

  Tissue tissue(const Eigen::Vector3d& p) const override;
  Eigen::Vector3d texture_point_mm(const Eigen::Vector3d& p, Tissue) const override;

  /// Signed distance to the skin in mm, negative inside the body.
  float depth_outside_mm(const Eigen::Vector3d& p) const;
  /// Unit vector out of the body, near its surface.
  Eigen::Vector3d skin_normal(const Eigen::Vector3d& p) const;
  /// Whether the point lies in the CT, at least `margin_mm` from its borders.
  bool holds(const Eigen::Vector3d& p, double margin_mm) const;
  const Eigen::Vector3d& kidney_centre_mm() const { return kidney_centre_mm_; }
  /// Points spread evenly over the kidney's surface; over a sphere if the kidney has no label.
  const std::vector<Eigen::Vector3d>& surface_mm() const { return surface_mm_; }

 private:
  struct LabelledTissue {
    int label;
    Tissue tissue;
    Volume<float> distance_mm;  // signed, negative inside

    float at(const Eigen::Vector3d& p) const;
  };

  Tissue inside_kidney(const Eigen::Vector3d& p, float depth_mm, float hu) const;
  Tissue by_hu(float hu, float depth_mm, float kidney_mm) const;
  void set_kidney_centre(const MaskVolume& mask);
  void find_surface(bool labelled);
  void place_bubbles(std::uint64_t seed, int count);

  std::uint64_t seed_;
  float bone_hu_;
  Volume<float> hu_;
  Volume<float> body_mm_;  // signed distance to the skin, negative inside
  std::vector<LabelledTissue> labelled_;
  Eigen::Vector3d kidney_centre_mm_ = Eigen::Vector3d::Zero();
  std::vector<Eigen::Vector3d> surface_mm_;
};

}  // namespace usct::phantom
