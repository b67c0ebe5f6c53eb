#include "us_ct_registration/rendering/fusion_view.h"

#include <algorithm>
#include <cmath>

#include "rendering/panel_marks.h"
#include "rendering/registration_panels.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/rendering/result_marks.h"
#include "us_ct_registration/simulation/simulation.h"
#include "us_ct_registration/ultrasound/beam_ultrasound.h"
#include "us_ct_registration/ultrasound/ultrasound.h"

namespace usct {
namespace {

using rendering::Panels;

constexpr double kTextSize = 0.55;
constexpr double kHeadlineSize = 0.65;

/// The word and the colour of a standing.
struct StandingMark {
  const char* word;
  Picture::Colour colour;
};

StandingMark mark_of(PoseStanding standing) {
  switch (standing) {
    case PoseStanding::kAccepted:
      return {"ACCEPTED", {0, 150, 70}};
    case PoseStanding::kWaiting:
      return {"WAITING", {230, 130, 0}};
    case PoseStanding::kRefused:
      return {"REFUSED", {235, 30, 30}};
    case PoseStanding::kNone:
      break;
  }
  return {"NO POSE", {150, 150, 150}};
}

const char* kind_of(FusionMode mode) {
  switch (mode) {
    case FusionMode::kUltrasound:
      return "ultrasound";
    case FusionMode::kContours:
      return "lines of the CT";
    case FusionMode::kBlend:
      return "US blue, CT orange";
    case FusionMode::kCheckerboard:
      return "US and CT in squares";
    case FusionMode::kSimulated:
      return "simulated from the CT";
  }
  return "";
}

/// The name of one of the planes of `Panels::planes`, and the directions of its axes.
struct PlaneWords {
  const char* name;
  const char* axes;
};
constexpr std::array<PlaneWords, 3> kPlaneWords = {{{"elevation plane", "lateral ->, depth down"},
                                                    {"lateral plane", "elevation ->, depth down"},
                                                    {"axial plane", "lateral ->, elevation down"}}};

/// Draws the panels of one view.
class Painter {
 public:
  Painter(const ScanConverted& us, const CtVolume* ct, const ScanConverted* simulated,
          const FusionPose& pose, const FusionViewOptions& options)
      : pose_(pose),
        mode_(pose.T_us_ct ? options.mode : FusionMode::kUltrasound),
        pixel_mm_(options.pictures.pixel_mm),
        panels_(pose.T_us_ct ? Panels(us, *ct, *pose.T_us_ct, options.pictures)
                             : Panels(us, options.pictures)) {
    if (mode_ == FusionMode::kSimulated) simulated_.emplace(*simulated, options.pictures);
  }

  /// One of the planes, without texts.
  Picture content(std::size_t i) const {
    const SlicePlane& plane = panels_.planes()[i];
    switch (mode_) {
      case FusionMode::kContours:
        return panels_.overlay(plane, *pose_.T_us_ct);
      case FusionMode::kBlend:
        return blend(panels_.ultrasound(plane), panels_.computed(plane, *pose_.T_us_ct));
      case FusionMode::kCheckerboard:
        return checkerboard(panels_.ultrasound(plane), panels_.computed(plane, *pose_.T_us_ct));
      case FusionMode::kSimulated:
        return simulated_->ultrasound(plane);
      case FusionMode::kUltrasound:
        break;
    }
    return panels_.ultrasound(plane);
  }

  /// The picture of a plane by itself.
  Picture alone(std::size_t i, const Picture& content) const {
    std::vector<std::vector<Picture>> parts{{marked(i, content)}};
    if (mode_ == FusionMode::kContours) {
      Picture legend(content.width,
                     static_cast<int>(panels_.levels().size()) * rendering::line_px(kTextSize));
      int bottom = -rendering::kMarginPx;
      for (const ContourLevel& level : panels_.levels())
        draw_text(legend, level.name, rendering::kMarginPx, bottom += rendering::line_px(kTextSize),
                  level.colour, kTextSize);
      parts.push_back({legend});
    }
    return tile(parts);
  }

  Picture sheet(const std::array<Picture, 3>& contents) const {
    std::vector<std::vector<Picture>> rows(1);
    for (std::size_t i = 0; i < contents.size(); ++i) rows[0].push_back(marked(i, contents[i]));
    if (mode_ != FusionMode::kUltrasound) {
      rows.emplace(rows.begin());
      for (std::size_t i = 0; i < contents.size(); ++i)
        rows[0].push_back(
            captioned(i, panels_.ultrasound(panels_.planes()[i]), FusionMode::kUltrasound));
    }
    const Picture body = tile(rows);
    const StandingMark mark = mark_of(pose_.standing);
    std::vector<std::vector<Picture>> parts{
        {rendering::text_block(pose_.headline, body.width,
                               {kHeadlineSize, {255, 255, 255}, mark.colour})},
        {body}};
    if (mode_ == FusionMode::kContours) {
      Picture legend(body.width, rendering::line_px(kTextSize));
      panels_.draw_legend(legend, rendering::kMarginPx, legend.height - rendering::kMarginPx);
      parts.push_back({legend});
    }
    if (!pose_.evidence.empty())
      parts.push_back({rendering::text_block(pose_.evidence, body.width, {kTextSize})});
    return tile(parts);
  }

 private:
  /// The picture with its scale and the patient's directions, below the names of plane and axes.
  Picture captioned(std::size_t i, Picture picture, FusionMode mode) const {
    const SlicePlane& plane = panels_.planes()[i];
    rendering::draw_ticks(picture, plane, panels_.centre_us_mm());
    rendering::draw_scale_bar(picture, pixel_mm_, kTextSize);
    if (pose_.T_us_ct)
      rendering::draw_patient_directions(picture, plane, *pose_.T_us_ct, kHeadlineSize);
    const std::string words =
        std::string(kPlaneWords[i].name) + ": " + kind_of(mode) + "\n" + kPlaneWords[i].axes;
    return tile({{rendering::text_block(words, picture.width, {kTextSize})}, {picture}});
  }

  Picture marked(std::size_t i, Picture content) const {
    const StandingMark mark = mark_of(pose_.standing);
    rendering::draw_frame(content, mark.word, mark.colour, kHeadlineSize);
    return captioned(i, std::move(content), mode_);
  }

  const FusionPose& pose_;
  FusionMode mode_;
  double pixel_mm_;
  Panels panels_;
  std::optional<Panels> simulated_;
};

}  // namespace

ScanConverted in_fusion_space(const PreScanVolume& us, double spacing_mm) {
  constexpr double kHoleFillMm = 4.0;
  CompoundOptions compounding;
  compounding.hole_fill_radius_mm = kHoleFillMm;
  return in_space(us, spacing_mm, compounding);
}

FusionView draw_fusion_view(const ScanConverted& us, const CtVolume* ct,
                            const ScanConverted* simulated, const FusionPose& pose,
                            const FusionViewOptions& options) {
  const bool is_simulated = pose.T_us_ct && options.mode == FusionMode::kSimulated;
  if ((pose.T_us_ct && ct == nullptr) || (is_simulated && simulated == nullptr))
    throw InputError("fusion view",
                     is_simulated ? "has no simulated ultrasound to draw" : "has no CT to draw");
  const Painter painter(us, ct, simulated, pose, options);
  const std::array<Picture, 3> contents{painter.content(0), painter.content(1), painter.content(2)};
  return {painter.alone(0, contents[0]), painter.alone(1, contents[1]),
          painter.alone(2, contents[2]), painter.sheet(contents)};
}

PreScanVolume simulate_like(const PreScanVolume& us, const CtVolume& ct,
                            const Eigen::Isometry3d& T_us_ct) {
  const BeamUltrasound beams = along_beams(us);
  const SimulatedUltrasound simulated = fit_to_ultrasound(
      simulate_components(beams.beams, ct, T_us_ct.inverse(), {}), beams.brightness, {}, {});
  if (!simulated.has_fit()) throw InputError("simulated ultrasound", simulated.message);
  PreScanVolume result = us;
  std::transform(simulated.brightness.begin(), simulated.brightness.end(), result.voxels.begin(),
                 [](float grey) {
                   return static_cast<std::uint8_t>(std::lround(std::clamp(grey, 0.0F, 255.0F)));
                 });
  return result;
}

}  // namespace usct
